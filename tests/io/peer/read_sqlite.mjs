// SPDX-License-Identifier: Apache-2.0
// Prints a database of rosbag2 (.db3) as JSON, decoded by the reader's own list of ROS 2 types. `npm install` first.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { print_messages } from './print_messages.mjs';

const require = createRequire(import.meta.url);
const { Rosbag2 } = require('@foxglove/rosbag2');
const { SqliteSqljs } = require('@foxglove/rosbag2-web');

globalThis.File ??= class {}; // of browsers, and of node since version 20
await SqliteSqljs.Initialize({ wasmBinary: readFileSync(require.resolve('@foxglove/sql.js/dist/sql-wasm.wasm')) });
const bag = new Rosbag2([new SqliteSqljs(new Uint8Array(readFileSync(process.argv[2])))]);
await bag.open();
const messages = [];
for await (const { topic, timestamp, value } of bag.readMessages()) {
  const time = BigInt(timestamp.sec) * 1000000000n + BigInt(timestamp.nsec);
  messages.push({ topic: topic.name, type: topic.type, time, data: value });
}
print_messages({ messages });
