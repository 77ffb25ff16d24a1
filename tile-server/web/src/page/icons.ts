//! Stroke paths of the page's icons on a 24 x 24 raster.

export const PLAY = "M8 5.500v13l10.500-6.500z";
export const PAUSE = "M8.500 5.500v13M15.500 5.500v13";
export const BACK = "M15 5.500 8.500 12l6.500 6.500";
export const FORWARD = "M9 5.500 15.500 12 9 18.500";
export const PLUS = "M12 5.500v13M5.500 12h13";
export const MINUS = "M5.500 12h13";
export const NORTH = "M12 4 7.500 19.500 12 16.500l4.500 3z";
export const HOUSE = "M4.500 11.500 12 5l7.500 6.500M6.500 10v9h11v-9";
export const PICTURE = "M4.500 6h15v12h-15zM4.500 15.500l4.500-4 4 3.500 2.500-2 4 3M15.500 9.500h.01";
export const CLOSE = "M6 6l12 12M18 6 6 18";
export const DOWNLOAD = "M12 4.500v10.500M7.500 11l4.500 4.500 4.500-4.500M5 19.500h14";
export const COPY = "M9 9h10v10.500H9zM15 9V4.500H5V15h4";
export const PENCIL = "M4.500 4.500h15v15h-15zM4.500 4.500h.01M19.500 19.500h.01";
export const PIN =
  "M12 20.500s-6-5.500-6-10.500a6 6 0 0 1 12 0c0 5-6 10.500-6 10.500zM12 12a2 2 0 1 0 0-4 2 2 0 0 0 0 4z";
export const BARS = "M5 19.500v-6M10 19.500V8M15 19.500v-9M20 19.500V5";
export const TICK = "M4.500 12.500l5 5 10-11";
export const LINK =
  "M10 14a4 4 0 0 0 6 .5l3-3a4 4 0 0 0-5.700-5.700l-1 1M14 10a4 4 0 0 0-6-.5l-3 3a4 4 0 0 0 5.700 5.700l1-1";
export const WAVE = "M3.500 14c2.800 0 2.800-4 5.700-4s2.800 4 5.600 4 2.800-4 5.700-4M12 4v3";
export const SLIDERS = "M4.500 8h8M16.500 8h3M14.500 6v4M4.500 16h3M11.500 16h8M9.500 14v4";
