// A client of an Isomatch server: encode meshes, start a job, watch it, fetch
// the map. proto/README.md tells what each call may answer.

import {createHash, randomUUID} from 'node:crypto';
import {once} from 'node:events';
import {setTimeout as sleep} from 'node:timers/promises';
import {fileURLToPath} from 'node:url';

import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';
import draco3d from 'draco3d';

// A copy of proto/isomatch/v1/service.proto, so that this folder runs wherever it is.
const API = fileURLToPath(new URL('service.proto', import.meta.url));
const TERMINAL = ['STATE_SUCCEEDED', 'STATE_FAILED', 'STATE_CANCELLED'];

// Room in a request for all but the meshes.
const REQUEST_OVERHEAD_BYTES = 4096;

const encoder = await draco3d.createEncoderModule({});

/**
 * Returns a client of the service at HOST:PORT. `tls`: {ca, cert, key}, PEM as
 * Buffers; cert and key only for a certificate of one's own.
 */
export function connect(server, {tls, apiKey} = {}) {
  const definition = protoLoader.loadSync(API, {
    longs: String, enums: String, oneofs: true, defaults: true,
  });
  const {CorrespondenceService} = grpc.loadPackageDefinition(definition).isomatch.v1;
  const credentials = tls ? grpc.credentials.createSsl(tls.ca, tls.key, tls.cert)
                          : grpc.credentials.createInsecure();
  // An interceptor, because gRPC's call credentials want TLS.
  const addKey = (options, next) => new grpc.InterceptingCall(next(options), {
    start(metadata, listener, nextStart) {
      metadata.set('authorization', `Bearer ${apiKey}`);
      nextStart(metadata, listener);
    },
  });
  return new CorrespondenceService(server, credentials, {
    'grpc.keepalive_time_ms': 25000, 'grpc.keepalive_timeout_ms': 10000,
    'grpc.max_reconnect_backoff_ms': 1000,
    interceptors: apiKey ? [addKey] : [],
  });
}

/**
 * Whether a call that ended so is worth another attempt: a server that stops ends its
 * calls as cancelled, a proxy that loses its server resets their streams.
 */
function isLost({code, details = ''}) {
  return code === grpc.status.UNAVAILABLE || code === grpc.status.CANCELLED ||
      (code === grpc.status.INTERNAL && details.includes('RST_STREAM'));
}

/** Whether an error has this reason, see "Errors" in proto/README.md. */
function reasonIs({metadata}, reason) {
  return (metadata?.get('grpc-status-details-bin') ?? []).some((status) => status.includes(reason));
}

/** Pauses between attempts that lose the server, about ten seconds in all. */
class Backoff {
  reset() {
    this.pause = 100;
    this.giveUp = undefined;
  }
  constructor() {
    this.reset();
  }
  /** Waits for the next attempt; throws `error` when there is to be none. */
  async after(error) {
    this.giveUp ??= Date.now() + 10_000;
    if (!isLost(error) || Date.now() + this.pause > this.giveUp) throw error;
    // Clients of a server that comes back do not come together.
    await sleep(this.pause * (0.8 + 0.4 * Math.random()));
    this.pause = Math.min(2 * this.pause, 2000);
  }
}

/** The answer of an RPC with one request and one response, as a promise. */
export async function call(client, rpc, request) {
  const backoff = new Backoff();
  for (;;) {
    try {
      return await new Promise((resolve, reject) => {
        client[rpc](request, (error, answer) => error ? reject(error) : resolve(answer));
      });
    } catch (error) {
      await backoff.after(error);
    }
  }
}

/**
 * The coordinates as they travel, as `isomatch match` sends them. Of a mesh far from the
 * origin single precision would leave little: it comes nearer by a multiple of the power
 * of two from 8 to 16 times its extent.
 */
function nearOrigin({vertices, faces}) {
  const low = [Infinity, Infinity, Infinity];
  const high = low.map((x) => -x);
  for (const v of faces) {
    for (let axis = 0; axis < 3; ++axis) {
      low[axis] = Math.min(low[axis], vertices[3 * v + axis]);
      high[axis] = Math.max(high[axis], vertices[3 * v + axis]);
    }
  }
  const extent = Math.max(...high.map((x, axis) => x - low[axis]));
  if (!(extent > 0)) return Float32Array.from(vertices);
  let power = Math.floor(Math.log2(extent));
  if (2 ** power > extent) --power;  // log2 rounds
  const step = 2 ** (power + 4);
  const origin = high.map((x, axis) => Math.floor((0.5 * (low[axis] + x)) / step + 0.5) * step);
  return Float32Array.from(vertices, (x, i) => x - origin[i % 3]);
}

/**
 * Returns {vertices, faces} (Float64Array of 3n, Uint32Array of 3m) as Draco
 * bytes, in single precision. Edgebreaker reorders vertices; so each carries its
 * number, in an attribute that VERTEX_ORDER_ID_ATTRIBUTE finds by its metadata.
 */
export function encode({vertices, faces}) {
  const count = vertices.length / 3;
  const mesh = new encoder.Mesh();
  const builder = new encoder.MeshBuilder();
  const metadata = new encoder.Metadata();
  const metadataBuilder = new encoder.MetadataBuilder();
  builder.AddFacesToMesh(mesh, faces.length / 3, faces);
  builder.AddFloatAttribute(mesh, encoder.POSITION, count, 3, nearOrigin({vertices, faces}));
  const ids = builder.AddUInt32Attribute(
      mesh, encoder.GENERIC, count, 1, Uint32Array.from({length: count}, (_, i) => i));
  metadataBuilder.AddStringEntry(metadata, 'name', 'vertex_id');
  builder.SetMetadataForAttribute(mesh, ids, metadata);

  const expert = new encoder.ExpertEncoder(mesh);
  const out = new encoder.DracoInt8Array();
  expert.SetEncodingMethod(encoder.MESH_EDGEBREAKER_ENCODING);
  const size = expert.EncodeToDracoBuffer(/*deduplicate_values=*/ false, out);
  const bytes = Buffer.alloc(size);
  for (let i = 0; i < size; ++i) bytes[i] = out.GetValue(i);
  for (const object of [out, expert, metadataBuilder, metadata, builder, mesh]) {
    encoder.destroy(object);
  }
  if (size === 0) throw new Error('Draco cannot encode this mesh');
  return bytes;
}

const digestOf = (bytes) =>
    ({sha256: createHash('sha256').update(bytes).digest('hex'), sizeBytes: bytes.length});

/** Brings the bytes to the server, unless it has them; goes on where it broke off. */
async function upload(client, bytes, chunkBytes) {
  const digest = digestOf(bytes);
  const backoff = new Backoff();
  for (;;) {
    const {missing, receivedBytes} = await call(client, 'FindMissingMeshes', {digests: [digest]});
    if (missing.length === 0) return digest;
    try {
      await sendFrom(client, Number(receivedBytes[0]), bytes, digest, chunkBytes);
      return digest;
    } catch (error) {
      await backoff.after(error);
    }
  }
}

async function sendFrom(client, offset, bytes, digest, chunkBytes) {
  let stream;
  const answered = new Promise((resolve, reject) => {
    stream = client.UploadMesh((error, answer) => error ? reject(error) : resolve(answer));
  });
  stream.write({header: digest, offset});
  const send = async () => {
    for (let at = offset; at < bytes.length; at += chunkBytes) {
      const room = stream.write({chunk: bytes.subarray(at, at + chunkBytes)});
      if (!room) await once(stream, 'drain');
    }
    stream.end();
    await answered;
  };
  // The server may answer before the last chunk: it knows the mesh, or refuses.
  await Promise.race([answered, send()]);
}

/** Seconds as google.protobuf.Duration. */
function durationOf(seconds) {
  const nanos = Math.round(seconds * 1e9);
  return {seconds: Math.floor(nanos / 1e9), nanos: nanos % 1e9};
}

/**
 * Starts a job and returns it. `options`: MatchOptions of service.proto, with
 * camelCase names; `landmarks`: [{x, y}, ...]; `deadline`: seconds after which the best map
 * that there is is the result.
 */
export async function createJob(client, meshX, meshY, {
  options = {}, landmarks = [], deadline,
} = {}) {
  const {limits} = await call(client, 'GetServerInfo', {});
  const meshes = [encode(meshX), encode(meshY)];
  const inline = meshes[0].length + meshes[1].length + 16 * landmarks.length +
      REQUEST_OVERHEAD_BYTES <= Number(limits.maxRequestBytes);
  const requestId = randomUUID();  // so that a retry cannot start a second job
  const create = async () => {
    const messages = [];
    for (const [i, draco] of meshes.entries()) {
      const source = inline ? {draco}
                            : {digest: await upload(client, draco, Number(limits.maxChunkBytes))};
      const vertexCount = [meshX, meshY][i].vertices.length / 3;
      messages.push({...source, vertexOrder: 'VERTEX_ORDER_ID_ATTRIBUTE', vertexCount});
    }
    return call(client, 'CreateJob', {
      meshX: messages[0], meshY: messages[1], landmarks, options, requestId,
      ...deadline !== undefined && {deadline: durationOf(deadline)},
      disconnectPolicy: 'DISCONNECT_POLICY_CANCEL',  // if we vanish
    });
  };
  // A mesh may go between upload and CreateJob: another's DeleteJob took the last job that
  // named it, or its bytes are damaged, which shows when they are read.
  const {job} = await create().catch((error) => {
    if (reasonIs(error, 'MESH_MISSING')) return create();
    throw error;
  });
  return job;
}

/** The job's snapshots up to the terminal one; a lost stream goes on. */
export async function* watch(client, name) {
  const backoff = new Backoff();
  let afterSequence = 0;
  for (;;) {
    const stream = client.WatchJob({name, afterSequence});
    try {
      for await (const {job} of stream) {
        backoff.reset();
        afterSequence = job.sequence;
        yield job;
        if (TERMINAL.includes(job.state)) return;
      }
    } catch (error) {
      await backoff.after(error);
    } finally {
      stream.cancel();
    }
  }
}

/** The bytes of a part of the result, verified; a lost stream goes on. */
export async function download(client, name, part = 'RESULT_PART_MAP') {
  const backoff = new Backoff();
  let header;
  let bytes = Buffer.alloc(0);
  for (let complete = false; !complete;) {
    try {
      for await (const message of client.DownloadResult({name, part, offset: bytes.length})) {
        backoff.reset();
        if (message.part === 'header') header = message.header;
        else bytes = Buffer.concat([bytes, message.chunk]);
      }
      complete = true;
    } catch (error) {
      await backoff.after(error);
    }
  }
  const {sha256} = digestOf(bytes);
  if (sha256 !== header.digest.sha256) {
    throw new Error(`${part} arrived damaged: SHA-256 ${sha256}, not ${header.digest.sha256}`);
  }
  return bytes;
}

/** STAGE_GEODESICS as 'geodesics'. Of a stage that this client does not know: 'working'. */
export function labelOf(name) {
  const [, label] = /^[A-Z]+_(\w+)$/.exec(name) ?? [, 'working'];
  return label === 'UNSPECIFIED' ? 'starting' : label.toLowerCase().replaceAll('_', ' ');
}

/** A verdict in a line; null is that of a server that does not judge. */
export function verdictText(verdict) {
  const {level = '', reason, advice} = verdict ?? {};
  const known = /^LEVEL_(GOOD|DOUBTFUL|BAD)$/.exec(level);
  return (known ? known[1].toLowerCase() : 'unknown') + (reason ? ` (${reason})` : '') +
      (advice ? `: ${advice}` : '');
}

/** For each vertex of X its vertex of Y, or -1 for one without a counterpart. */
export function decodeMap(bytes) {
  return Array.from({length: bytes.length / 4}, (_, i) => bytes.readInt32LE(4 * i));
}
