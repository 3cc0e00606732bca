import { open } from "/work/web/web/test/chromium.mjs";
import { serve } from "/work/web/web/test/server.mjs";

const address = await serve({ page: "/work/web/target/web/page" });
const browser = await open();
const p = await (await browser.newContext()).newPage();
p.on("console", (m) => console.log("console:", m.text()));
p.on("pageerror", (e) => console.log("pageerror:", `${e}`));
await p.goto(`${address}/page/index.html${process.argv[2] ?? ""}`);
await p
  .waitForFunction(() => document.body.dataset.firstPictureMs, undefined, { timeout: 60000 })
  .catch((e) => console.log(`${e}`));
for (const id of ["class", "facts", "error"]) console.log(id, await p.locator(`#${id}`).textContent());
console.log(await p.evaluate(() => document.body.dataset.firstPictureMs));
await p.waitForTimeout(500);
await p.screenshot({ path: process.argv[3] ?? "/tmp/page.png" });
await browser.close();
