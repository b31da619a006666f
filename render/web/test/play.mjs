// node play.mjs JOB.json: plays models in a headless Chromium and prints what came of it as JSON.
//
// JOB: { chromium, cases: [{ url, output, cameras: [frame of a transforms.json], frames, sizes: [[name, w, h, isPhone]] }] }.
// Of each case come `exceptions`, `errors`, `requests`, `notice`, `message`; where the model plays also `state`, `size` and
// `frame_ms`, with pictures in `output`: NNNN.png per camera, NAME.png of the page in each size.

import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { Browser } from './browser.mjs';

const PATIENCE_S = 120;

async function play(page, { url, output, cameras = [], frames = 0, sizes = [] }) {
  await page.visit(url);
  await page.until('window.turnlight !== undefined && (turnlight.ready.then(() => window.settled = true, () => window.settled = true), window.settled === true)', PATIENCE_S);
  const refused = `document.getElementById('loading').classList.contains('refused')`;
  const report = {};
  if (!(await page.evaluate(refused))) {
    report.state = await page.evaluate('turnlight.complete()');
    for (const [i, camera] of cameras.entries()) {
      await page.evaluate(`turnlight.setCamera(${JSON.stringify(camera)})`);
      const picture = await page.evaluate('turnlight.screenshot()');
      writeFileSync(join(output, `${String(i).padStart(4, '0')}.png`), Buffer.from(picture.split(',')[1], 'base64'));
    }
    if (frames > 0) report.frame_ms = median(await page.evaluate(`turnlight.benchmark(${frames})`));
    if (cameras.length > 0) await page.evaluate('turnlight.setCamera(null)');
  }
  for (const [name, width, height, isPhone] of sizes) {
    await page.call('Emulation.setDeviceMetricsOverride', { width, height, deviceScaleFactor: isPhone ? 2 : 1, mobile: isPhone });
    await new Promise((resolve) => setTimeout(resolve, 1500));
    writeFileSync(join(output, `${name}.png`), await page.screenshot());
  }
  report.notice = await page.evaluate(`document.getElementById('notice').textContent`);
  report.message = (await page.evaluate(refused)) ? await page.evaluate(`document.getElementById('message').textContent`) : null;
  return { ...report, exceptions: page.exceptions, errors: page.errors, requests: page.requests };
}

const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];

const job = JSON.parse(readFileSync(process.argv[2], 'utf8'));
const browser = await Browser.start(job.chromium);
const reports = [];
try {
  for (const entry of job.cases) {
    const page = await browser.page(800, 600);
    reports.push(await play(page, entry).catch((fault) => ({ failed: fault.message, exceptions: page.exceptions, errors: page.errors })));
    await page.close();
  }
} finally {
  await browser.stop();
}
console.log(JSON.stringify(reports, null, 1));
