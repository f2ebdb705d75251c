// SPDX-License-Identifier: Apache-2.0
import { createHash } from 'node:crypto';

/// As JSON; of pixels and points the SHA-256.
export function print_messages(bag) {
  for (const { data } of bag.messages) {
    if (!(data.data instanceof Uint8Array)) continue;
    data.sha256 = createHash('sha256').update(data.data).digest('hex');
    delete data.data;
  }
  const plain = (_, value) => (typeof value === 'bigint' ? Number(value) : ArrayBuffer.isView(value) ? [...value] : value);
  console.log(JSON.stringify(bag, plain));
}
