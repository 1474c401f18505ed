// Bundles src/ and copies public/ into the Python package, with the licences of what was bundled.
import { build } from "esbuild";
import { cp, mkdir, readFile, readdir, rm, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";

const here = fileURLToPath(new URL(".", import.meta.url));
const out = fileURLToPath(new URL("../service/shipshape/console/static/", import.meta.url));

await rm(out, { recursive: true, force: true });
await mkdir(out, { recursive: true });
const { metafile } = await build({
  absWorkingDir: here,
  entryPoints: ["src/main.ts", "src/style.css"],
  outdir: out,
  bundle: true,
  splitting: true, // the 3D library is loaded with the first cluster, not with the page
  format: "esm",
  target: "es2022",
  minify: true,
  chunkNames: "[name]-[hash]",
  legalComments: "none", // licences.txt holds them whole
  metafile: true,
});
await cp(`${here}public`, out, { recursive: true });
await writeFile(`${out}licences.txt`, await licences(metafile));

/** The licence of each package that gave a file to the bundle. */
async function licences(metafile) {
  const inputs = Object.keys(metafile.inputs).map((path) => /node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(path)?.[1]);
  const texts = [...new Set(inputs.filter(Boolean))].sort().map(async (name) => {
    const folder = `${here}node_modules/${name}/`;
    const { version } = JSON.parse(await readFile(`${folder}package.json`, "utf8"));
    const file = (await readdir(folder)).find((entry) => /^licen[cs]e/i.test(entry));
    if (!file) throw new Error(`expected a licence in ${folder}, got none`);
    return `${name} ${version}\n\n${await readFile(folder + file, "utf8")}`;
  });
  return `The console holds these packages.\n\n${(await Promise.all(texts)).join(`\n${"-".repeat(80)}\n\n`)}`;
}
