// What Khronos' validator says of glTF files, and their attributes. Usage: node glb.js MODULES FILE... Prints a list.
'use strict';
const fs = require('fs');
const path = require('path');
const { createRequire } = require('module');

const [modules, ...files] = process.argv.slice(2);
const validator = createRequire(path.join(path.resolve(modules), 'here.js'))('gltf-validator');

async function main() {
  const all = [];
  for (const file of files) {
    const bytes = fs.readFileSync(file);
    const report = await validator.validateBytes(new Uint8Array(bytes), { maxIssues: 20 });
    const length = bytes.readUInt32LE(12);
    all.push({
      file,
      issues: report.issues,
      info: report.info,
      json: JSON.parse(bytes.subarray(20, 20 + length).toString()),
    });
  }
  console.log(JSON.stringify(all, null, 1));
}
main().catch((failure) => {
  console.error(failure);
  process.exit(1);
});
