// SPDX-License-Identifier: GPL-3.0-or-later
//
// Usage: node hl7_client.mjs PORT < messages.json      [text, …] with CR between segments
//        node hl7_client.mjs parse < message.json      { text, paths: ["OBX.3.1", …] }
// node-hl7-client sends each message and prints what it was answered; or it reads one of ours.
import { readFileSync } from 'node:fs';
import { Client, Message } from 'node-hl7-client';

const input = JSON.parse(readFileSync(0, 'utf8'));

function observations(message) {
  const found = [];
  message.get('OBX').forEach((s) =>
    found.push([s.get('3.1').toString(), s.get('5').toString(), s.get('6').get('1').toString()]));
  return found;
}

if (process.argv[2] === 'parse') {
  const message = new Message({ text: input.text });
  console.log(JSON.stringify({
    type: message.get('MSH.9.1').toString(),
    observations: observations(message),
  }));
} else {
  const client = new Client({ host: '127.0.0.1' });
  const answers = [];
  for (const text of input) {
    await new Promise((resolve, reject) => {
      const connection = client.createConnection({ port: Number(process.argv[2]) }, async (res) => {
        const message = res.getMessage();
        answers.push({
          type: message.get('MSH.9.1').toString(),
          ack: message.get('MSA.1').toString(),
          id: message.get('MSA.2').toString(),
          text: message.toString(),
        });
        await connection.close();
        resolve();
      });
      connection.sendMessage(new Message({ text })).catch(reject);
    });
  }
  client.closeAll();
  console.log(JSON.stringify(answers));
  process.exit(0);
}
