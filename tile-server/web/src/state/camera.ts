//! Where the camera is and what a place is: degrees, and kilometres above the ground.

export interface CameraView {
  lon: number;
  lat: number;
  heightKm: number;
  headingDeg: number;
  pitchDeg: number;
}

export interface Place {
  lon: number;
  lat: number;
}

/** The tropical Pacific, where the sea breathes out most, with both subtropical sinks in sight. */
export const HOME: CameraView = { lon: -150, lat: 8, heightKm: 15000, headingDeg: 0, pitchDeg: -90 };
