// Makes HTML templates of src/ and the packages: node build.js PAIR.html FOLDER.html.
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
/** What their licenses want to be in every copy, and so in every page. */
const notices = ['three', 'three-mesh-bvh'].map((name) =>
    `${name}\n\n${readFileSync(join(here, 'node_modules', name, 'LICENSE'), 'utf8').trim()}`);
notices.push('Draco decoder\n\nCopyright The Draco Authors, Apache License, Version 2.0');
const notice = `/*!\nThis page contains:\n\n${notices.join('\n\n')}\n*/\n`;

const source = (name) => readFileSync(join(here, 'src', name), 'utf8').trimEnd();

/** Writes the page `name`.html, its marks replaced in this order, what both pages have first. */
async function writePage(output, name, parts) {
  let page = source(`${name}.html`);
  for (const [mark, text] of Object.entries({
    '<!--HEAD-->': source('head.html'), '<!--SHOWN-->': source('shown.html'), ...parts,
  })) {
    if (!page.includes(mark)) throw new Error(`${name}.html has no ${mark}`);
    page = page.replace(mark, () => text);
  }
  writeFileSync(output, `${page}\n`);
}

const [pairOutput, folderOutput] = process.argv.slice(2);
await writePage(pairOutput, 'page', {
  '/*FRAMES*/': '',
  '/*STYLE*/': await bundle('style.css'),
  '/*DRACO*/': inScript(notice + draco),
  '/*SCRIPT*/': inScript(await bundle('main.js')),
});
await writePage(folderOutput, 'folder', {
  '/*FRAMES*/': "; frame-src 'self' file:",
  // Its script has the other mark, to put the page of a pair together.
  '<!--TITLE-->': '<!--FOLDER-->',
  '/*STYLE*/': await bundle('folder.css'),
  '/*SCRIPT*/': inScript(await bundle('folder.js')),
});
