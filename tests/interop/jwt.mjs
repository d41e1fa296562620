// SPDX-License-Identifier: GPL-3.0-or-later
//
// Usage: node jwt.mjs < wish.json
// wish: { keys: { name: "ES384"|"RS384"|"ES256"|"RS1024" }, tokens: [{ key, alg, kid, claims }] }
//        node jwt.mjs verify < { token, jwk }     prints { head, claims, valid }
// Prints { jwks: { name: JWK }, pem: { name: PEM }, tokens: [compact form] }. Node's own
// cryptography signs, so that the daemon's is checked by another's.
import { createHmac, createPublicKey, generateKeyPairSync, sign, verify } from 'node:crypto';
import { readFileSync } from 'node:fs';

const kinds = {
  ES384: ['ec', { namedCurve: 'P-384' }],
  ES256: ['ec', { namedCurve: 'P-256' }],
  RS384: ['rsa', { modulusLength: 2048 }],
  RS1024: ['rsa', { modulusLength: 1024 }],
};
const wish = JSON.parse(readFileSync(0, 'utf8'));
if (process.argv[2] === 'verify') {
  const [head, claims, signature] = wish.token.split('.');
  const key = { key: createPublicKey({ key: wish.jwk, format: 'jwk' }), dsaEncoding: 'ieee-p1363' };
  const text = (part) => JSON.parse(Buffer.from(part, 'base64url'));
  console.log(JSON.stringify({
    head: text(head),
    claims: text(claims),
    valid: verify('sha384', Buffer.from(`${head}.${claims}`), key, Buffer.from(signature, 'base64url')),
  }));
  process.exit(0);
}
const made = Object.fromEntries(
  Object.entries(wish.keys).map(([name, kind]) => [name, generateKeyPairSync(...kinds[kind])]));
const b64 = (value) => Buffer.from(JSON.stringify(value)).toString('base64url');

function token({ key, alg, kid, claims }) {
  const text = `${b64({ alg, kid, typ: 'JWT' })}.${b64(claims)}`;
  if (alg === 'none') return `${text}.`;
  const { privateKey, publicKey } = made[key];
  if (alg.startsWith('HS')) {
    const secret = publicKey.export({ type: 'spki', format: 'pem' });
    return `${text}.${createHmac('sha384', secret).update(text).digest('base64url')}`;
  }
  const options = { key: privateKey, dsaEncoding: 'ieee-p1363' };
  return `${text}.${sign(`sha${alg.slice(2)}`, Buffer.from(text), options).toString('base64url')}`;
}

const each = (make) => Object.fromEntries(Object.entries(made).map(([n, pair]) => [n, make(n, pair)]));
console.log(JSON.stringify({
  jwks: each((n, pair) => ({ ...pair.publicKey.export({ format: 'jwk' }), kid: n })),
  pem: each((n, pair) => pair.privateKey.export({ type: 'pkcs8', format: 'pem' })),
  tokens: (wish.tokens ?? []).map(token),
}));
