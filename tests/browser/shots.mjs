// SPDX-License-Identifier: GPL-3.0-or-later
import { chromium } from 'playwright-core';
import { StandIn } from './stand_in.mjs';
const out = process.argv[2] ?? '/tmp/shots';
const s = new StandIn(new URL('../../static/dist', import.meta.url).pathname);
const base = await s.start();
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox','--disable-quic','--no-first-run','--disable-background-networking','--disable-component-update','--disable-sync','--use-angle=swiftshader','--enable-unsafe-swiftshader','--ignore-gpu-blocklist'] });
const sizes = { d: [1366, 768], w: [1920, 1080], p: [390, 844] };
for (const [n, [w, h]] of Object.entries(sizes)) {
  const page = await browser.newPage({ viewport: { width: w, height: h }, locale: 'en-GB' });
  page.on('console', m => console.log(n, m.type(), m.text()));
  page.on('pageerror', e => console.log(n, 'ERR', e.message));
  await page.goto(base + '/');
  await page.waitForSelector('.side');
  await page.screenshot({ path: `${out}/form-empty-${n}.png` });
  await page.click('text=Fill in');
  await page.screenshot({ path: `${out}/form-${n}.png`, fullPage: n === 'p' });
  await page.fill('#left-R1', '1,234.5'); await page.fill('#right-eM', '80'); await page.fill('#right-R2','6'); await page.fill('#left-muM', '12,5');
  await page.click('button[type=submit]');
  await page.screenshot({ path: `${out}/form-faults-${n}.png`, fullPage: true });
  await page.click('text=Fill in');
  await page.click('button[type=submit]');
  await page.waitForSelector('.running', {timeout: 5000}).catch(()=>{});
  await page.screenshot({ path: `${out}/running-${n}.png` });
  await page.waitForFunction(() => document.querySelectorAll('.glance').length === 2);
  await page.waitForTimeout(500);
  await page.screenshot({ path: `${out}/result-${n}.png` });
  await page.screenshot({ path: `${out}/result-full-${n}.png`, fullPage: true });
  await page.locator('text=3-D').first().click();
  await page.waitForSelector('canvas'); await page.waitForTimeout(2500);
  await page.screenshot({ path: `${out}/view3d-${n}.png` });
  if (n === 'd') await page.pdf({ path: `${out}/report.pdf`, preferCSSPageSize: true });
  await page.goto(base + '/assessments'); await page.waitForSelector('table.list');
  await page.screenshot({ path: `${out}/list-${n}.png` });
  await page.close();
}
await browser.close(); await s.finish();
