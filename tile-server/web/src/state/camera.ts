//! Where the camera is and what a place is: degrees, and kilometres above the ground.

export interface CameraView {
  lon: number;
  lat: number;
  heightKm: number;
  headingDeg: number;
  pitchDeg: number;
  /** Lean to the right about the line of sight. */
  rollDeg: number;
}

export interface Place {
  lon: number;
  lat: number;
}

/** The tropical Pacific, where the sea breathes out most, with both subtropical sinks in sight. */
export const HOME: CameraView = { lon: -150, lat: 8, heightKm: 15000, headingDeg: 0, pitchDeg: -90, rollDeg: 0 };
/** From over the Amazon across the coast of Peru and Ecuador to the equatorial Pacific, where what the sea gave off stands highest. */
export const COAST: CameraView = { lon: -66, lat: -8, heightKm: 1600, headingDeg: 282, pitchDeg: -41, rollDeg: 0 };
/** Opening of the shorter side, the same as the server's camera has, so that its pictures show what the globe shows. */
export const OPENING_DEG = 45;
/** The server draws the earth as a sphere. */
export const SPHERE_RADIUS_M = 6_371_000;
