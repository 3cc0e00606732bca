// Chromium without a window and without a GPU: WebGL and WebGPU by SwiftShader, the latter with Dawn and Tint.
import { chromium } from "playwright-core";

const FLAGS = [
  "--headless=new",
  "--no-sandbox",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--enable-unsafe-webgpu",
  "--use-webgpu-adapter=swiftshader",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

export const open = (executablePath = "/usr/bin/chromium") =>
  chromium.launch({ executablePath, args: FLAGS, headless: false });

/** What goes wrong in a page from now on: errors, and requests that `isAllowed` refuses. */
export function faultsOf(page, isAllowed) {
  const faults = [];
  page.on("request", (request) => isAllowed(request.url()) || faults.push(`request: ${request.url().slice(0, 100)}`));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("pageerror", (error) => faults.push(`${error}`));
  return faults;
}
