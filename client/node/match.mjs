// node match.mjs X Y -o MAP: matches two meshes on an Isomatch server.

import {readFileSync, renameSync, writeFileSync} from 'node:fs';
import {extname} from 'node:path';
import {parseArgs} from 'node:util';

import {
  call, connect, createJob, decodeMap, download, labelOf, verdictText, watch,
} from './isomatch.mjs';
import {readMesh} from './mesh_file.mjs';

const USAGE = `Usage: node match.mjs X Y -o MAP [options]

X, Y: meshes, .off, .obj, .ply or .stl. MAP: text, line i has the vertex of Y for vertex i of X.

  --server HOST:PORT      127.0.0.1:7443 by default
  --tls-ca FILE           encrypts, and checks the server's certificate
  --profile NAME          default or paper
  --random-seed N         1 by default
  --deadline SECONDS      takes the best map there is then
  --cancel-after SECONDS  gives up then, as Ctrl-C does at any time

ISOMATCH_API_KEY in the environment is sent along.

  isomatch sample --pose A --vertices 2000 -o a.off
  isomatch sample --pose B --vertices 2000 -o b.off
  node match.mjs a.off b.off -o map.txt`;

const OPTIONS = {
  output: {type: 'string', short: 'o'},
  server: {type: 'string', default: '127.0.0.1:7443'},
  'tls-ca': {type: 'string'},
  profile: {type: 'string', default: 'default'},
  'random-seed': {type: 'string', default: '1'},
  deadline: {type: 'string'},
  'cancel-after': {type: 'string'},
  help: {type: 'boolean', short: 'h'},
};

const MOST_SEED = 2n ** 64n - 1n;
const MOST_TIMER_SECONDS = 2147483;  // of setTimeout, which fires at once beyond

// Names under which other programs expect other contents.
const OTHER_FORMATS = new Set((
  '.3ds .bmp .csv .dae .drc .fbx .gif .glb .gltf .gz .htm .html .jpeg .jpg .json .mat .msh .npy ' +
  '.npz .obj .off .pdf .pkl .ply .png .pt .py .stl .svg .tif .tiff .toml .vtk .vtp .webp .xml ' +
  '.yaml .zip').split(' '));

class UsageError extends Error {}

/** What is wrong with the options, beside what parseArgs finds. */
function check({
  output, profile, 'random-seed': seed, 'cancel-after': seconds = '0', deadline = '1',
}) {
  if (!output) throw new Error('expected -o MAP');
  const extension = extname(output).toLowerCase();
  if (OTHER_FORMATS.has(extension)) {
    throw new Error(`--output '${output}': the extension is '${extension}', ` +
                    'expected .txt, or no extension');
  }
  if (!['default', 'paper'].includes(profile)) {
    throw new Error(`--profile is '${profile}', expected default or paper`);
  }
  if (!/^\d+$/.test(seed) || BigInt(seed) > MOST_SEED) {
    throw new Error(`--random-seed: '${seed}', expected a whole number from 0 to ${MOST_SEED}`);
  }
  if (!/^\d+(\.\d+)?$/.test(deadline) || !(Number(deadline) > 0)) {
    throw new Error(`--deadline: '${deadline}', expected seconds above 0`);
  }
  if (!/^\d+(\.\d+)?$/.test(seconds) || Number(seconds) > MOST_TIMER_SECONDS) {
    throw new Error(`--cancel-after: '${seconds}', expected 0 to ${MOST_TIMER_SECONDS} seconds`);
  }
}

function parse() {
  try {
    const {values, positionals} = parseArgs({options: OPTIONS, allowPositionals: true});
    if (values.help) return values;
    if (positionals.length !== 2) throw new Error('expected two meshes, X and Y');
    check(values);
    return {...values, x: readMesh(positionals[0]), y: readMesh(positionals[1])};
  } catch (error) {
    throw new UsageError(error.message);
  }
}

/** Follows the job to its end, on one line of a terminal. */
async function follow(client, name) {
  let job;
  for await (job of watch(client, name)) {
    if (!process.stderr.isTTY) continue;
    const percent = Math.round(100 * job.progress.totalFraction);
    const label = job.state === 'STATE_RUNNING' ? job.progress.stage : job.state;
    process.stderr.write(`\r\x1b[K${percent} %  ${labelOf(label)}`);
  }
  if (process.stderr.isTTY) process.stderr.write('\n');
  return job;
}

async function main() {
  const args = parse();
  if (args.help) return console.log(USAGE);
  const client = connect(args.server, {
    tls: args['tls-ca'] && {ca: readFileSync(args['tls-ca'])},
    apiKey: process.env.ISOMATCH_API_KEY,
  });
  const options = {
    profile: `PROFILE_${args.profile.toUpperCase()}`, randomSeed: args['random-seed'],
  };
  const {name} = await createJob(client, args.x, args.y, {
    options, deadline: args.deadline && Number(args.deadline),
  });
  const cancel = () => call(client, 'CancelJob', {name}).catch(() => {});
  process.once('SIGINT', cancel);
  console.error(name);
  if (args['cancel-after']) setTimeout(cancel, 1000 * args['cancel-after']).unref();

  const job = await follow(client, name);
  if (job.state === 'STATE_SUCCEEDED') {
    const map = decodeMap(await download(client, name));
    writeFileSync(`${args.output}.part`, map.join('\n') + '\n');
    renameSync(`${args.output}.part`, args.output);
    console.error(`${map.length} vertices matched, written to ${args.output}`);
    for (const warning of job.result.warnings) console.error(`warning: ${warning}`);
    console.error(`verdict: ${verdictText(job.result.verdict)}`);
  } else {
    console.error(job.error ? `${job.error.message} (${job.error.reason})` : 'cancelled');
    process.exitCode = job.error ? 1 : 130;
  }
  client.close();
}

main().catch((error) => {
  console.error(`match.mjs: ${error.details ?? error.message}`);
  process.exit(error instanceof UsageError || error.code === 3 ? 2 : 1);
});
