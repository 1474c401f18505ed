// One contact over gRPC from Node, with types made of the proto when it starts.
//
//   npm --prefix examples/node install && node examples/node/client.js          # or: client.js HOST:50051
import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import grpc from "@grpc/grpc-js";
import loader from "@grpc/proto-loader";

const path = (name) => fileURLToPath(new URL(name, import.meta.url));
const proto = path("../../proto/shipshape/v1/shipshape.proto");
const pcd = readFileSync(path("../contact.pcd"));
const address = process.argv[2] ?? "127.0.0.1:50051";

const { Shipshape } = grpc.loadPackageDefinition(loader.loadSync(proto, { keepCase: true })).shipshape.v1;
const client = new Shipshape(address, grpc.credentials.createInsecure(), { "grpc.enable_http_proxy": 0 });
// The points of a binary PCD file follow its header: little-endian float32 x y z, metres, level frame.
const points = pcd.subarray(pcd.indexOf("DATA binary\n") + "DATA binary\n".length);
const request = { contact: { points, sensor_height_m: 3 } };

client.Recognise(request, { deadline: Date.now() + 10_000 }, (error, response) => {
  client.close();
  if (error) {
    console.error(`client.js: ${grpc.status[error.code]}: ${error.details}`);
    process.exitCode = 1;
    return;
  }
  const { vessel, probability, heading } = response.recognition;
  console.log(`${vessel} ${probability.toFixed(4)} ${((heading * 180) / Math.PI).toFixed(2)}`);
});
