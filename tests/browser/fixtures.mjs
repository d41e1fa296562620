// SPDX-License-Identifier: GPL-3.0-or-later
//
// Fields for the stand-in: a small block of hexahedra with a dent on top, in the format of the
// daemon's field.vtu, and a section picture. Shapes to look at, not results.

const cells = { radial: 10, layers: 8 };

function positions(p) {
  const half = p.eM + p.eF;
  const tip = 1 + p.eF + p.eM;
  const list = [];
  const layers = [0, 1, 1 + p.eF / 2, 1 + p.eF];
  for (let k = 0; k <= cells.layers; k++) {
    for (let j = 0; j <= cells.radial; j++) {
      for (let i = 0; i <= cells.radial; i++) {
        const [x, y] = [half * (i / cells.radial) ** 1.5, half * (j / cells.radial) ** 1.5];
        const bowl = Math.min(p.R1, p.R1 * ((x / 18) ** 2 + (y / 9) ** 2));
        const top = tip + bowl;
        const z =
          k < 4 ? layers[k] : layers[3] + (top - layers[3]) * ((k - 3) / (cells.layers - 3));
        const tied = k === cells.layers && bowl < p.R1;
        const squeeze = 0.55 * Math.exp(-((x / 30) ** 2 + (y / 30) ** 2));
        const u_z = tied ? -0.55 * tip : -squeeze * z;
        const u_r = tied ? 0 : 0.5 * squeeze * Math.exp(-((z - tip / 2) ** 2) / 300);
        list.push({ x, y, z, u: [x * u_r, y * u_r, u_z] });
      }
    }
  }
  return list;
}

function corners() {
  const n = cells.radial + 1;
  const at = (i, j, k) => (k * n + j) * n + i;
  const list = [];
  for (let k = 0; k < cells.layers; k++)
    for (let j = 0; j < cells.radial; j++)
      for (let i = 0; i < cells.radial; i++)
        list.push([
          at(i, j, k),
          at(i + 1, j, k),
          at(i + 1, j + 1, k),
          at(i, j + 1, k),
          at(i, j, k + 1),
          at(i + 1, j, k + 1),
          at(i + 1, j + 1, k + 1),
          at(i, j + 1, k + 1),
        ]);
  return list;
}

function array(type, name, values, components = 1) {
  const Kind = { Float64: Float64Array, Int32: Int32Array, UInt8: Uint8Array }[type];
  const data = Buffer.from(Kind.from(values).buffer);
  const head = Buffer.alloc(8);
  head.writeBigUInt64LE(BigInt(data.length));
  const text = Buffer.concat([head, data]).toString('base64');
  const attribute = components > 1 ? ` NumberOfComponents="${components}"` : '';
  return `<DataArray type="${type}" Name="${name}"${attribute} format="binary">${text}</DataArray>\n`;
}

export function field_vtu(p) {
  const nodes = positions(p);
  const hexes = corners();
  const centre = hexes.map((h) =>
    [0, 1, 2].map((a) => h.reduce((s, n) => s + [nodes[n].x, nodes[n].y, nodes[n].z][a], 0) / 8),
  );
  const layer = hexes.map((_, e) => Math.floor(e / cells.radial ** 2));
  const tissue = layer.map((k) => (k === 0 ? 2 : k < 3 ? 1 : 0));
  const tip = 1 + p.eF + p.eM;
  const shear = centre.map(
    ([x, y, z]) => 1.5 * Math.exp(-((x * x + y * y) / 250 + (z - tip) ** 2 / 150)),
  );
  const cluster = shear.map((E, e) => (E > 0.75 && tissue[e] === 0 ? 1 : 0));
  return [
    '<?xml version="1.0" encoding="UTF-8"?>\n',
    '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n<UnstructuredGrid>\n',
    `<Piece NumberOfPoints="${nodes.length}" NumberOfCells="${hexes.length}">\n<PointData>\n`,
    array(
      'Float64',
      'displacement',
      nodes.flatMap((n) => n.u),
      3,
    ),
    '</PointData>\n<CellData>\n',
    array('UInt8', 'tissue', tissue),
    array('Float64', 'E_shear', shear),
    array(
      'Float64',
      'E_comp',
      shear.map((E) => 0.45 * Math.min(1.1, E)),
    ),
    array('Int32', 'cluster', cluster),
    '</CellData>\n<Points>\n',
    array(
      'Float64',
      'Points',
      nodes.flatMap((n) => [n.x + n.u[0], n.y + n.u[1], n.z + n.u[2]]),
      3,
    ),
    '</Points>\n<Cells>\n',
    array('Int32', 'connectivity', hexes.flat()),
    array(
      'Int32',
      'offsets',
      hexes.map((_, i) => 8 * (i + 1)),
    ),
    array(
      'UInt8',
      'types',
      hexes.map(() => 12),
    ),
    '</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n',
  ].join('');
}

export function section_svg(p) {
  const h = p.eM + p.eF;
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 300" width="400" height="300">
<rect width="400" height="300" fill="#fff"/><rect x="30" y="${250 - 2 * h}" width="340" height="${2 * h}" fill="#d9a59b"/>
<circle cx="200" cy="${250 - 2.2 * h}" r="${6 * p.R1}" fill="#fbf8ee" stroke="#555"/>
<text x="200" y="290" font-size="12" text-anchor="middle">section of the stand-in</text></svg>`;
}
