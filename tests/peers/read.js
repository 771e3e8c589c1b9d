// Reads a recording or a cloud with other people's readers: node read.js FILE OUT. OUT/index.json lists what is there, OUT/N.bin has
// the numbers: depth images as they are stored, points as doubles x y z.
'use strict';
const fs = require('fs');
const path = require('path');
const [file, out] = process.argv.slice(2);
fs.mkdirSync(out, { recursive: true });
const rows = [];

const write = (bytes) => {
  const name = `${rows.length}.bin`;
  fs.writeFileSync(path.join(out, name), bytes);
  return name;
};

/// One depth image's row; rows of the message may be padded, ours are not.
function take(topic, stamp, message) {
  const bytes = { '16UC1': 2, mono16: 2, '32FC1': 4 }[message.encoding];
  if (!bytes || message.is_bigendian)
    return;
  const data = Buffer.from(message.data.buffer, message.data.byteOffset, message.data.byteLength);
  const lines = [];
  for (let y = 0; y < message.height; ++y)
    lines.push(data.subarray(y * message.step, y * message.step + bytes * message.width));
  rows.push({
    topic,
    stamp_s: stamp.sec + (stamp.nsec ?? stamp.nanosec) * 1e-9,
    encoding: message.encoding,
    width: message.width,
    height: message.height,
    file: write(Buffer.concat(lines)),
  });
}

/// Depth packed as an image, which compare.py decodes.
function takePacked(topic, stamp, message) {
  if (/compressedDepth/.test(message.format))
    rows.push({ topic, stamp_s: stamp.sec + (stamp.nsec ?? stamp.nanosec) * 1e-9, encoding: message.format, file: write(message.data) });
}

/// (packed bytes, unpacked size) -> bytes
async function theirLz4() {
  const lz4 = require('@foxglove/wasm-lz4');
  await lz4.isLoaded;
  return (data, size) => new Uint8Array(lz4(data, Number(size)));
}

async function bag() {
  const { Bag } = require('@foxglove/rosbag');
  const { FileReader } = require('@foxglove/rosbag/node');
  const lz4 = await theirLz4();
  const bzip2 = require('seek-bzip');
  const read = new Bag(new FileReader(file), {
    decompress: { bz2: (data) => bzip2.decode(Buffer.from(data)), lz4 },
    parse: true,
  });
  await read.open();
  const kinds = { 'sensor_msgs/Image': take, 'sensor_msgs/CompressedImage': takePacked };
  const kindOf = new Map([...read.connections.values()].map((c) => [c.topic, kinds[c.type]]));
  for await (const event of read.messageIterator({ topics: [...kindOf.keys()].filter((topic) => kindOf.get(topic)) }))
    kindOf.get(event.topic)(event.topic, event.message.header.stamp, event.message);
}

async function mcap() {
  const { McapIndexedReader } = require('@mcap/core');
  const { parse } = require('@foxglove/rosmsg');
  const { MessageReader } = require('@foxglove/rosmsg2-serialization');
  const lz4 = await theirLz4();
  const zstd = require('fzstd');
  const handle = fs.openSync(file);
  const read = await McapIndexedReader.Initialize({
    readable: {
      size: async () => BigInt(fs.fstatSync(handle).size),
      read: async (offset, size) => {
        const bytes = new Uint8Array(Number(size));
        fs.readSync(handle, bytes, 0, bytes.length, Number(offset));
        return bytes;
      },
    },
    decompressHandlers: { lz4, zstd: (data) => zstd.decompress(data) },
  });
  const readers = new Map();
  for await (const event of read.readMessages()) {
    const channel = read.channelsById.get(event.channelId);
    const schema = read.schemasById.get(channel.schemaId);
    const kind = { 'sensor_msgs/msg/Image': take, 'sensor_msgs/msg/CompressedImage': takePacked }[schema.name];
    if (!kind)
      continue;
    if (!readers.has(channel.id))
      readers.set(channel.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
    const message = readers.get(channel.id).readMessage(event.data);
    kind(channel.topic, message.header.stamp, message);
  }
}

async function laz() {
  const perf = await require('laz-perf').createLazPerf();
  const bytes = fs.readFileSync(file);
  const scale = [0, 1, 2].map((i) => bytes.readDoubleLE(131 + 8 * i));
  const offset = [0, 1, 2].map((i) => bytes.readDoubleLE(155 + 8 * i));
  const at = perf._malloc(bytes.length);
  perf.HEAPU8.set(bytes, at);
  const read = new perf.LASZip();
  const before = process.hrtime.bigint();
  read.open(at, bytes.length);
  const point = perf._malloc(read.getPointLength());
  const points = new Float64Array(3 * read.getCount());
  for (let i = 0; i < read.getCount(); ++i) {
    read.getPoint(point);
    for (let axis = 0; axis < 3; ++axis)
      points[3 * i + axis] = perf.HEAP32[point / 4 + axis] * scale[axis] + offset[axis];
  }
  const took_ms = Number(process.hrtime.bigint() - before) / 1e6;
  rows.push({ points: read.getCount(), took_ms, file: write(Buffer.from(points.buffer)) });
}

/// All nodes, page by page from the root, in the order in which they lie in the file. Each must lie in its cube, and fields that
/// runs add must hold visibilities.
async function copc() {
  const { Copc } = require('copc');
  const head = await Copc.create(file);
  const nodes = {};
  for (const pages = [head.info.rootHierarchyPage]; pages.length > 0; ) {
    const part = await Copc.loadHierarchyPage(file, pages.pop());
    Object.assign(nodes, part.nodes);
    pages.push(...Object.values(part.pages));
  }
  const full = Object.entries(nodes).filter(([, node]) => node.pointCount > 0);
  full.sort(([, a], [, b]) => a.pointDataOffset - b.pointDataOffset);
  const added = head.eb.map((field) => field.name).filter((name) => /^(ambient_occlusion|ao_)/.test(name));
  const points = [];
  let outside = 0;
  let odd = 0;
  for (const [key, node] of full) {
    const view = await Copc.loadPointDataView(file, head, node);
    const [level, ...place] = key.split('-').map(Number);
    const side = (head.info.cube[3] - head.info.cube[0]) / 2 ** level;
    const axes = ['X', 'Y', 'Z'].map((axis) => view.getter(axis));
    const values = added.map((name) => view.getter(name));
    for (let i = 0; i < node.pointCount; ++i) {
      axes.forEach((at, axis) => {
        const low = head.info.cube[axis] + side * place[axis], step = head.header.scale[axis];
        points.push(at(i));
        outside += at(i) < low - step || at(i) > low + side + step;
      });
      odd += values.some((at) => at(i) < 0 || at(i) > 1);
    }
  }
  if (points.length !== 3 * head.header.pointCount || outside + odd > 0)
    throw new Error(`${points.length / 3} of ${head.header.pointCount} points; ${outside} coordinates outside of nodes, ${odd} odd values`);
  rows.push({ points: points.length / 3, nodes: full.length, added, file: write(Buffer.from(Float64Array.from(points).buffer)) });
}

const reader = /\.copc\.laz$/i.test(file) ? copc : { '.bag': bag, '.mcap': mcap, '.laz': laz }[path.extname(file)];
reader().then(() =>
  fs.writeFileSync(path.join(out, 'index.json'), JSON.stringify(rows)));
