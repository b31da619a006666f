// A headless Chromium, driven through its debugging pipe: node alone is needed.

import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

/** Renders WebGL 2 on Mesa's software rasteriser where there is no graphics hardware. */
const FLAGS = [
  '--headless', '--no-sandbox', '--use-angle=gl-egl', '--ignore-gpu-blocklist', '--remote-debugging-pipe',
  '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync',
  '--disable-default-apps', '--disable-extensions', '--disable-quic', '--disable-dev-shm-usage', '--mute-audio',
  '--force-device-scale-factor=1', '--hide-scrollbars',
];

export class Browser {
  static async start(program) {
    const profile = mkdtempSync(join(tmpdir(), 'turnlight-web-'));
    const child = spawn(program, [...FLAGS, `--user-data-dir=${profile}`], { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'] });
    return new Browser(child, profile);
  }

  constructor(child, profile) {
    Object.assign(this, { child, profile, next: 0, open: new Map(), pages: new Map() });
    let rest = '';
    child.stdio[4].setEncoding('utf8').on('data', (text) => {
      const parts = (rest + text).split('\0');
      rest = parts.pop();
      parts.forEach((part) => this.receive(JSON.parse(part)));
    });
    child.on('exit', () => this.open.forEach(({ reject }) => reject(new Error('the browser ended'))));
  }

  receive({ id, result, error, method, params, sessionId }) {
    if (id === undefined) return this.pages.get(sessionId)?.receive(method, params);
    const { resolve, reject } = this.open.get(id);
    this.open.delete(id);
    if (error) reject(new Error(error.message));
    else resolve(result);
  }

  call(method, params = {}, sessionId = undefined) {
    const id = ++this.next;
    this.child.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
    return new Promise((resolve, reject) => this.open.set(id, { resolve, reject }));
  }

  /** An empty page of this size in CSS pixels. */
  async page(width, height, isPhone = false) {
    const { targetId } = await this.call('Target.createTarget', { url: 'about:blank' });
    const { sessionId } = await this.call('Target.attachToTarget', { targetId, flatten: true });
    const page = new Page(this, sessionId, targetId);
    this.pages.set(sessionId, page);
    for (const domain of ['Page', 'Runtime', 'Network', 'Log']) await page.call(`${domain}.enable`);
    const metrics = { width, height, deviceScaleFactor: isPhone ? 2 : 1, mobile: isPhone };
    await page.call('Emulation.setDeviceMetricsOverride', metrics);
    return page;
  }

  async stop() {
    const ended = new Promise((resolve) => this.child.on('exit', resolve));
    await Promise.race([this.call('Browser.close').catch(() => {}), ended]);
    await ended;
    rmSync(this.profile, { recursive: true, force: true });
  }
}

/** A tab; keeps what it asked the network for and what went wrong in it. */
class Page {
  constructor(browser, session, target) {
    Object.assign(this, { browser, session, target, requests: [], exceptions: [], errors: [] });
  }

  call(method, params) {
    return this.browser.call(method, params, this.session);
  }

  receive(method, params) {
    if (method === 'Network.requestWillBeSent') this.requests.push(params.request.url);
    if (method === 'Runtime.exceptionThrown') this.exceptions.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    if (method === 'Runtime.consoleAPICalled' && params.type === 'error') this.errors.push(params.args.map((a) => a.value ?? a.description).join(' '));
    if (method === 'Log.entryAdded' && params.entry.level === 'error') this.errors.push(`${params.entry.text} ${params.entry.url ?? ''}`);
  }

  async visit(url) {
    Object.assign(this, { requests: [], exceptions: [], errors: [] });
    await this.call('Page.navigate', { url });
  }

  /** The value of an expression, which may be a promise; what it throws is thrown. */
  async evaluate(expression) {
    const { result, exceptionDetails } = await this.call('Runtime.evaluate', { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }

  /** Asks again until the answer is true, at most `seconds`. */
  async until(expression, seconds) {
    const end = Date.now() + 1000 * seconds;
    for (;;) {
      if (await this.evaluate(expression).catch(() => false)) return;
      if (Date.now() > end) throw new Error(`waited ${seconds} s for ${expression}`);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }

  /** PNG bytes of what the tab shows. */
  async screenshot() {
    const { data } = await this.call('Page.captureScreenshot', { format: 'png' });
    return Buffer.from(data, 'base64');
  }

  async close() {
    await this.browser.call('Target.closeTarget', { targetId: this.target });
  }
}
