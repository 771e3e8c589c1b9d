// Reads a run's recording with the public packages that Foxglove's programs use, and compares every message with the
// files beside it. Usage: node mcap.js MODULES OUT. Prints one object of JSON.
'use strict';
const fs = require('fs');
const path = require('path');
const { createRequire } = require('module');

const [modules, out, name = 'run.mcap'] = process.argv.slice(2);
const load = createRequire(path.join(path.resolve(modules), 'here.js'));
const { McapIndexedReader, McapStreamReader } = load('@mcap/core');
const { parse } = load('@foxglove/rosmsg');
const { MessageReader } = load('@foxglove/rosmsg2-serialization');
const fzstd = load('fzstd');

const bytes = fs.readFileSync(path.join(out, name));
const decompressHandlers = { zstd: (data) => fzstd.decompress(data) };
const found = { problems: [], topics: {}, frames: [], frame_ids: {}, metadata: 0 };
const problem = (text) => found.problems.length < 20 && found.problems.push(text);

/** Vertices of a binary PLY of floats, doubles and bytes: {property: [values]}. */
function plyColumns(file) {
  const data = fs.readFileSync(file);
  const end = data.indexOf('end_header\n') + 'end_header\n'.length;
  const lines = data.subarray(0, end).toString('latin1').split('\n');
  const count = Number(lines.find((line) => line.startsWith('element vertex')).split(' ')[2]);
  const sizes = { float: 4, double: 8, uchar: 1 };
  const reads = { float: 'readFloatLE', double: 'readDoubleLE', uchar: 'readUInt8' };
  const properties = lines.filter((line) => line.startsWith('property')).map((line) => line.split(' ').slice(1));
  const columns = Object.fromEntries(properties.map(([, property]) => [property, []]));
  let at = end;
  for (let i = 0; i < count; ++i)
    for (const [type, property] of properties) {
      columns[property].push(data[reads[type]](at));
      at += sizes[type];
    }
  return columns;
}

/** The same of a PointCloud2. */
function cloudColumns(cloud) {
  const data = Buffer.from(cloud.data.buffer, cloud.data.byteOffset, cloud.data.byteLength);
  const count = cloud.width * cloud.height;
  if (data.length !== count * cloud.point_step || cloud.row_step !== cloud.width * cloud.point_step)
    problem(`points: ${data.length} bytes for ${count} points of ${cloud.point_step}`);
  const columns = Object.fromEntries(cloud.fields.map((field) => [field.name, []]));
  for (let i = 0; i < count; ++i)
    for (const field of cloud.fields) {
      if (field.datatype !== 7 || field.count !== 1) problem(`field ${field.name} is no float`);
      const at = i * cloud.point_step + field.offset;
      columns[field.name].push(field.name === 'rgb' ? data.readUInt32LE(at) : data.readFloatLE(at));
    }
  return columns;
}

function comparePoints(frame, cloud) {
  const file = path.join(out, 'clouds', `${frame}.ply`);
  if (!fs.existsSync(file)) return;
  const ours = cloudColumns(cloud), theirs = plyColumns(file);
  const same = (a, b) => Object.is(a, b) || a === Math.fround(b); // far or measured in doubles
  for (const field of ['x', 'y', 'z', 'ambient_occlusion', 'ao_confidence']) {
    if (ours[field].length !== theirs[field].length)
      problem(`${frame}: ${ours[field].length} points, the PLY has ${theirs[field].length}`);
    const at = ours[field].findIndex((value, i) => !same(value, theirs[field][i]));
    if (at >= 0) problem(`${frame}: ${field} of point ${at} is ${ours[field][at]}, in the PLY ${theirs[field][at]}`);
  }
  if (theirs.red && !ours.rgb) problem(`${frame}: no colours`);
  if (ours.rgb) {
    const at = ours.rgb.findIndex((rgb, i) => rgb !== ((theirs.red[i] << 16) | (theirs.green[i] << 8) | theirs.blue[i]));
    if (at >= 0) problem(`${frame}: colour of point ${at}`);
    found.coloured_points = true;
  }
  found.compared_points = (found.compared_points ?? 0) + ours.x.length;
}

function compareFile(frame, folder, data) {
  const file = path.join(out, folder, `${frame}.png`);
  if (!fs.existsSync(file)) return;
  if (!fs.readFileSync(file).equals(Buffer.from(data))) problem(`${frame}: ${folder} differs from ${file}`);
  found.compared_files = (found.compared_files ?? 0) + 1;
}

async function main() {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(length)),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  found.profile = reader.header.profile;
  found.library = reader.header.library;
  found.chunks = reader.chunkIndexes.length;
  const decoders = new Map();
  for (const [id, channel] of reader.channelsById) {
    const schema = reader.schemasById.get(channel.schemaId);
    if (schema.encoding !== 'ros2msg' || channel.messageEncoding !== 'cdr')
      problem(`${channel.topic}: ${schema.encoding}, ${channel.messageEncoding}`);
    decoders.set(id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
    found.topics[channel.topic] = { type: schema.name, messages: 0 };
  }
  let last = 0n, frame = '', indexed = 0;
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    ++indexed;
    if (message.logTime < last) problem('messages are not in the order of time');
    last = message.logTime;
    const topic = reader.channelsById.get(message.channelId).topic;
    ++found.topics[topic].messages;
    const value = decoders.get(message.channelId).readMessage(message.data);
    const header = value.header ?? value.transforms?.[0]?.header;
    if (header) {
      const stamp = BigInt(header.stamp.sec) * 1000000000n + BigInt(header.stamp.nanosec ?? header.stamp.nsec);
      if (stamp !== message.logTime) problem(`${topic}: stamp ${stamp}, logged at ${message.logTime}`);
      found.frame_ids[topic] = value.transforms ? value.transforms.map((t) => `${t.header.frame_id}>${t.child_frame_id}`) : header.frame_id;
    }
    if (topic === '/scanshade/frame') {
      const facts = JSON.parse(value.data);
      frame = facts.name;
      found.frames.push({ ...facts, time_ns: Number(message.logTime) });
    } else if (topic === '/scanshade/points') {
      comparePoints(frame, value);
    } else if (topic === '/scanshade/camera_info') {
      found.camera = { width: value.width, height: value.height, k: [...value.k], d: [...value.d], model: value.distortion_model };
    } else if (topic === '/scanshade/depth') {
      found.depth = { width: value.width, height: value.height, encoding: value.encoding, step: value.step, bytes: value.data.length };
    } else if (topic.endsWith('/compressed')) {
      compareFile(frame, topic.split('/')[2], value.data);
      found.topics[topic].format = value.format;
    }
  }
  // From front to back: chunk by chunk, without the index.
  const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  stream.append(bytes);
  let streamed = 0, inSummary = null;
  for (let record; (record = stream.nextRecord()); ) {
    if (record.type === 'Message') ++streamed;
    if (record.type === 'Metadata') ++found.metadata;
    if (record.type === 'Statistics') inSummary = Number(record.messageCount);
  }
  if (!stream.done()) problem('the file does not end as it should');
  if (streamed !== indexed || inSummary !== indexed)
    problem(`${indexed} messages by the index, ${streamed} from front to back, ${inSummary} in the statistics`);
  found.messages = indexed;
  console.log(JSON.stringify(found, null, 1));
}
main().catch((failure) => {
  console.error(failure);
  process.exit(1);
});
