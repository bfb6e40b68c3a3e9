// Opens pages in a browser and prints what is wrong with them, one finding a line; exits with 1 if there is any.
// Usage: node audit.mjs BROWSER PAGE...
//
// Each page is laid out for a wide screen, light and dark, a phone and paper, with its details closed and open.
// Findings: serious and critical ones of axe-core (on the wide screen), script errors, requests to the network, a page wider than its
// window, text that is cut off, and in drawings text that leaves the drawing, overlaps other text or is too small.
import fs from "node:fs";
import path from "node:path";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

// The packages are installed beside the pages' build, not beside this file.
const require = createRequire(path.join(process.cwd(), "node_modules", "."));
const puppeteer = require("puppeteer-core");
const axe = fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");

const LAYOUTS = [
  { name: "wide", width: 1280, media: "screen", scheme: "light", axe: true },
  { name: "dark", width: 1280, media: "screen", scheme: "dark", axe: true },
  { name: "phone", width: 400, media: "screen", scheme: "light" },
  { name: "paper", width: 794, media: "print", scheme: "light" },
];

/** Runs in the page: what is out of place, as sentences. */
function misplaced() {
  const SMALLEST_PX = 9;
  const found = [];
  const page = document.documentElement;
  if (page.scrollWidth > page.clientWidth) {
    found.push(`the page is ${page.scrollWidth - page.clientWidth} px wider than its window`);
  }
  const isShown = (element) => {
    const box = element.getBoundingClientRect();
    return box.width > 0 && box.height > 0 && getComputedStyle(element).visibility !== "hidden";
  };
  const isTurned = (text) => (text.getAttribute("transform") ?? "").includes("rotate");
  for (const drawing of document.querySelectorAll("svg.plot")) {
    if (!isShown(drawing)) continue;
    const whole = drawing.getBoundingClientRect();
    const scale = whole.width / drawing.viewBox.baseVal.width;
    const texts = [...drawing.querySelectorAll("text")].filter(isShown);
    const boxes = texts.map((text) => text.getBoundingClientRect());
    texts.forEach((text, i) => {
      const box = boxes[i];
      const outside = Math.max(whole.left - box.left, box.right - whole.right, whole.top - box.top, box.bottom - whole.bottom);
      if (outside > 1) found.push(`"${text.textContent}" leaves its drawing by ${outside.toFixed(1)} px`);
      const size = parseFloat(getComputedStyle(text).fontSize) * scale;
      if (size < SMALLEST_PX) found.push(`"${text.textContent}" is ${size.toFixed(1)} px high`);
      for (let k = i + 1; k < texts.length; k++) {
        const width = Math.min(box.right, boxes[k].right) - Math.max(box.left, boxes[k].left);
        const height = Math.min(box.bottom, boxes[k].bottom) - Math.max(box.top, boxes[k].top);
        const isOver = width > 2 && height > 0.3 * Math.min(box.height, boxes[k].height);
        if (isOver && !isTurned(text) && !isTurned(texts[k])) {
          found.push(`"${text.textContent}" and "${texts[k].textContent}" overlap`);
        }
      }
    });
  }
  for (const element of document.querySelectorAll("td, th, p, li, dd, dt, h1, h2, h3, figcaption, summary")) {
    const isCut = element.scrollWidth > element.clientWidth + 1 && getComputedStyle(element).overflowX !== "visible";
    if (isShown(element) && isCut) found.push(`"${element.textContent.slice(0, 40)}" is cut off`);
  }
  return found;
}

/** Serious and critical findings of axe-core. */
async function inaccessible(tab) {
  await tab.evaluate(axe);
  const { violations } = await tab.evaluate(() => axe.run(document, { resultTypes: ["violations"] }));
  const serious = violations.filter((one) => ["serious", "critical"].includes(one.impact));
  return serious.map((one) => `axe: ${one.help} (${one.id}), ${one.nodes.length} times: ${one.nodes[0].html.slice(0, 100)}`);
}

async function findings(browser, file, layout) {
  const tab = await browser.newPage();
  const found = [];
  tab.on("pageerror", (error) => found.push(`script: ${error.message}`));
  tab.on("console", (message) => message.type() === "error" && found.push(`console: ${message.text()}`));
  tab.on("request", (request) => /^(https?|wss?|ftp):/.test(request.url()) && found.push(`asks the network for ${request.url()}`));
  await tab.setViewport({ width: layout.width, height: 900 });
  await tab.emulateMediaType(layout.media);
  await tab.emulateMediaFeatures([{ name: "prefers-color-scheme", value: layout.scheme }]);
  await tab.goto(pathToFileURL(file).href, { waitUntil: "load" });
  found.push(...(await tab.evaluate(misplaced)));
  if (layout.media === "screen") {
    await tab.evaluate(() => document.querySelectorAll("details").forEach((part) => (part.open = true)));
    found.push(...(await tab.evaluate(misplaced)));
  }
  if (layout.axe) found.push(...(await inaccessible(tab)));
  await tab.close();
  return [...new Set(found)];
}

const [executablePath, ...files] = process.argv.slice(2);
const browser = await puppeteer.launch({ executablePath, args: ["--no-sandbox", "--disable-dev-shm-usage"] });
let count = 0;
for (const file of files) {
  for (const layout of LAYOUTS) {
    for (const finding of await findings(browser, file, layout)) {
      console.log(`${path.basename(file)}, ${layout.name}: ${finding}`);
      count += 1;
    }
  }
}
await browser.close();
console.log(`${files.length} pages, ${count} findings`);
process.exit(count > 0 ? 1 : 0);
