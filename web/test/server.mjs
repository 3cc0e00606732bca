// Serves folders on this machine, for a browser.
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm" };

/** Serves each folder of `folders` under its name; returns the address. */
export function serve(folders) {
  const server = createServer(async ({ url }, response) => {
    const [, name, ...rest] = normalize(new URL(url, "http://localhost").pathname).split("/");
    try {
      const content = await readFile(join(folders[name], ...rest));
      response.setHeader("content-type", TYPES[extname(url.split("?")[0])] ?? "application/octet-stream");
      response.end(content);
    } catch {
      response.statusCode = url === "/favicon.ico" ? 204 : 404;
      response.end();
    }
  });
  server.unref();
  return new Promise((resolve) => {
    server.listen(0, "127.0.0.1", () => resolve(`http://localhost:${server.address().port}`));
  });
}
