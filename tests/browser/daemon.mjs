// SPDX-License-Identifier: GPL-3.0-or-later
//
// A real ischiad for a test: its own state directory, a port of its own that survives a restart.
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';

export class Daemon {
  constructor(program, worker) {
    this.program = program;
    this.worker = worker;
    this.listen = '127.0.0.1:0';
  }

  /* Resolves to the address it serves, the same one after a restart. */
  async start() {
    this.state ??= await mkdtemp(join(tmpdir(), 'ischia-browser-'));
    const options = ['--listen', this.listen, '--state-dir', this.state, '--workers', '2'];
    this.process = spawn(this.program, [...options, '--worker-program', this.worker], {
      stdio: ['ignore', 'pipe', 'ignore'],
    });
    for await (const line of createInterface({ input: this.process.stdout })) {
      const origin = /listening on (http:\S+)/.exec(line)?.[1];
      if (!origin) continue;
      this.listen = origin.replace('http://', '');
      this.process.stdout.resume();
      return origin;
    }
    throw new Error(`${this.program} did not start`);
  }

  async end(signal) {
    if (this.process.exitCode !== null || this.process.signalCode !== null) return;
    const gone = once(this.process, 'exit');
    this.process.kill(signal);
    await gone;
  }

  async finish() {
    await this.end('SIGTERM');
    await rm(this.state, { recursive: true, force: true });
  }
}
