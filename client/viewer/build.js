// Makes one HTML template of src/ and the packages: node build.js OUTPUT.
import {readFileSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const require = createRequire(import.meta.url);

async function bundle(entry) {
  const result = await build({
    entryPoints: [join(here, 'src', entry)],
    bundle: true, minify: true, write: false, charset: 'ascii',
    format: 'iife', target: 'es2022', legalComments: 'inline',
    loader: {'.wasm': 'binary'},
  });
  return result.outputFiles[0].text;
}

/** A script must not end the element that holds it. */
const inScript = (code) => code.replaceAll('</script', '<\\/script');

// An old-style script, which sets a global; it does not bundle.
const draco = readFileSync(
    require.resolve('three/examples/jsm/libs/draco/draco_wasm_wrapper.js'), 'utf8');
const parts = {
  '/*STYLE*/': await bundle('style.css'),
  '/*DRACO*/': inScript(draco),
  '/*SCRIPT*/': inScript(await bundle('main.js')),
};
let page = readFileSync(join(here, 'src', 'page.html'), 'utf8');
for (const [mark, text] of Object.entries(parts)) page = page.replace(mark, () => text);
writeFileSync(process.argv[2], page);
