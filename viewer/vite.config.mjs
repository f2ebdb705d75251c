// SPDX-License-Identifier: Apache-2.0
import { defineConfig } from "vite";
import { viteSingleFile } from "vite-plugin-singlefile";

export default defineConfig({
  root: "src",
  plugins: [viteSingleFile()],
  esbuild: { charset: "ascii", legalComments: "none" },
  build: { outDir: "../dist", emptyOutDir: true, target: "es2021", modulePreload: false },
});
