// Prints as JSON what each MCAP file that is named holds, read by MCAP's own JavaScript.
import { readFileSync } from "node:fs";

import { crc32, crc32Final, crc32Init, crc32Update } from "@foxglove/crc";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor.js";

function decoder(schema) {
  if (schema.encoding !== "protobuf") {
    return (data) => JSON.parse(new TextDecoder().decode(data));
  }
  const files = descriptor.FileDescriptorSet.decode(schema.data);
  const type = protobuf.Root.fromDescriptor(files).resolveAll().lookupType(schema.name);
  return (data) => type.decode(data);
}

function describeCloud(cloud) {
  return {
    frame: cloud.frame_id,
    fields: cloud.fields.map((field) => field.name),
    points: cloud.data.length / cloud.point_stride,
    crc: crc32(cloud.data),
  };
}

function readAll(bytes) {
  const [schemas, channels, topics] = [new Map(), new Map(), {}];
  const found = { topics, metadata: {}, attachments: {} };
  const reader = new McapStreamReader({ validateCrcs: true });
  reader.append(bytes);
  for (let record = reader.nextRecord(); record; record = reader.nextRecord()) {
    if (record.type === "Schema" && !schemas.has(record.id)) {
      schemas.set(record.id, { ...record, decode: decoder(record) });
    } else if (record.type === "Channel" && !channels.has(record.id)) {
      const schema = schemas.get(record.schemaId);
      const encoding = record.messageEncoding;
      channels.set(record.id, { topic: record.topic, schema, crc: crc32Init() });
      topics[record.topic] = { schema: schema.name, encoding, count: 0, times: [], clouds: [] };
    } else if (record.type === "Message") {
      const channel = channels.get(record.channelId);
      const topic = topics[channel.topic];
      const content = channel.schema.decode(record.data);
      topic.count += 1;
      topic.times.push(Number(record.logTime));
      channel.crc = crc32Update(channel.crc, record.data);
      if (topic.schema === "foxglove.PointCloud") {
        topic.clouds.push(describeCloud(content));
      }
    } else if (record.type === "Metadata") {
      found.metadata[record.name] = Object.fromEntries(record.metadata);
    } else if (record.type === "Attachment") {
      found.attachments[record.name] = { type: record.mediaType, crc: crc32(record.data) };
    }
  }
  if (!reader.done()) {
    throw new Error("bytes are left over");
  }
  for (const { topic, crc } of channels.values()) {
    topics[topic].crc = crc32Final(crc);
  }
  return found;
}

async function countByIndex(bytes) {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => bytes.subarray(Number(offset), Number(offset + length)),
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const counts = {};
  for await (const message of reader.readMessages()) {
    const { topic } = reader.channelsById.get(message.channelId);
    counts[topic] = (counts[topic] ?? 0) + 1;
  }
  return counts;
}

const answers = [];
for (const path of process.argv.slice(2)) {
  const bytes = new Uint8Array(readFileSync(path));
  answers.push({ ...readAll(bytes), indexed: await countByIndex(bytes) });
}
console.log(JSON.stringify(answers));
