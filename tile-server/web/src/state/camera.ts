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
/** Over the equatorial Pacific towards South America: a flat look along the coast, where what the sea gives off stands high. */
export const COAST: CameraView = { lon: -104, lat: -6, heightKm: 1300, headingDeg: 78, pitchDeg: -23, rollDeg: 0 };
/** Opening of the shorter side, the same as the server's camera has, so that its pictures show what the globe shows. */
export const OPENING_DEG = 45;
/** The server draws the earth as a sphere. */
export const SPHERE_RADIUS_M = 6_371_000;
