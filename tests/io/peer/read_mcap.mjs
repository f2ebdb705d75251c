// SPDX-License-Identifier: Apache-2.0
// Prints an MCAP file as JSON: read by its index, decoded by the schemas in it. `npm install` first.
import { readFileSync } from 'node:fs';
import { McapIndexedReader } from '@mcap/core';
import { parse } from '@foxglove/rosmsg';
import { MessageReader } from '@foxglove/rosmsg2-serialization';
import { decompress } from 'fzstd';
import { print_messages } from './print_messages.mjs';

const bytes = readFileSync(process.argv[2]);
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
};
const reader = await McapIndexedReader.Initialize({
  readable,
  decompressHandlers: { zstd: (packed) => decompress(packed) },
});
const decoders = new Map();
const messages = [];
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  if (!decoders.has(schema.id)) {
    decoders.set(schema.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  const data = decoders.get(schema.id).readMessage(message.data);
  messages.push({ topic: channel.topic, type: schema.name, time: message.logTime, data });
}
print_messages({ profile: reader.header.profile, statistics: reader.statistics, messages });
