// Reads a recording with npm's @mcap/core, by its index and as a stream, and decodes every
// protobuf message by the schema in the file. Prints what it found as JSON.
import { open, readFile } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";

const path = process.argv[2];
const decompressHandlers = await loadDecompressHandlers();
const plain = (_, value) => (typeof value === "bigint" ? String(value) : value);

const readable = new FileHandleReadable(await open(path));
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const parsers = new Map();
const topics = {};
const states = [];
let last = -1n;
for await (const message of reader.readMessages({ validateCrcs: true })) {
  if (message.logTime < last) throw new Error("messages are not in order of time");
  last = message.logTime;
  const channel = reader.channelsById.get(message.channelId);
  topics[channel.topic] = (topics[channel.topic] ?? 0) + 1;
  if (channel.messageEncoding !== "protobuf") continue;
  if (!parsers.has(channel.id)) {
    const schema = reader.schemasById.get(channel.schemaId);
    parsers.set(channel.id, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
  }
  const decoded = parsers.get(channel.id).decode(message.data);
  if (channel.topic.endsWith("/state")) {
    states.push({ time: message.logTime, status: decoded.status, angles: [...decoded.angles] });
  }
}
const metadata = [];
for await (const record of reader.readMetadata()) metadata.push(record.name);

const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(await readFile(path));
let streamed = 0;
for (let record; (record = stream.nextRecord()); ) if (record.type === "Message") streamed++;
if (!stream.done()) throw new Error("the stream does not end");

const messages = reader.statistics.messageCount;
console.log(JSON.stringify({ topics, states, metadata, messages, streamed }, plain));
