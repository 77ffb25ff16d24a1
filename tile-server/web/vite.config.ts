//! Build of the viewer: one page, relative addresses, and Cesium's own static files beside it, so that nothing is asked elsewhere.
import { cp } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { defineConfig, type Plugin } from "vite";

/** Cesium loads its workers and pictures by address at run time; a bundler cannot see those, so they are copied. */
const CESIUM_STATIC = ["Workers", "Assets", "Widgets", "ThirdParty"];
const CESIUM_BASE_URL = "cesium";

function copyCesiumStatic(): Plugin {
  const from = fileURLToPath(new URL("./node_modules/cesium/Build/Cesium/", import.meta.url));
  let outDir = "dist";
  return {
    name: "copy-cesium-static",
    apply: "build",
    configResolved(config) {
      outDir = config.build.outDir;
    },
    async closeBundle() {
      const to = fileURLToPath(new URL(`./${outDir}/${CESIUM_BASE_URL}/`, import.meta.url));
      for (const part of CESIUM_STATIC) {
        await cp(from + part, to + part, { recursive: true });
      }
    },
  };
}

export default defineConfig({
  base: "./",
  define: { CESIUM_BASE_URL: JSON.stringify(CESIUM_BASE_URL) },
  plugins: [copyCesiumStatic()],
  build: {
    target: "es2022",
    // Cesium is one large library used on the only page there is: splitting it would not make the first view faster.
    chunkSizeWarningLimit: 8000,
    rollupOptions: { output: { manualChunks: { cesium: ["cesium"] } } },
  },
});
