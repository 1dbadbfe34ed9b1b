// Builds the one asset of the page: the template with styles and program in it.
// `node build.mjs FILE` writes to FILE in place of ../data/page.html.
import { readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const here = (name) => new URL(name, import.meta.url);
const bundle = async (entry, options = {}) => {
  const result = await build({
    entryPoints: [here(entry).pathname],
    bundle: true,
    minify: true,
    write: false,
    target: "es2022",
    charset: "utf8",
    legalComments: "inline",
    ...options,
  });
  return result.outputFiles[0].text.trim();
};

const template = await readFile(here("page.html"), "utf8");
const style = await bundle("style.css");
const program = await bundle("src/main.ts", { format: "iife" });
const licence = (await readFile(here("node_modules/uplot/LICENSE"), "utf8")).trim();
const page = template
  .replace("/*licence*/", () => licence)
  .replace("/*style*/", () => style)
  .replace("/*program*/", () => program);
await writeFile(process.argv[2] ?? here("../data/page.html"), page);
