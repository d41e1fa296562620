// SPDX-License-Identifier: GPL-3.0-or-later
//
// Reads what the daemon writes at .../field.vtu: one piece of hexahedra, arrays as base64 of a
// 64-bit byte count and little-endian values (see solver/vtu.h).

export interface Field {
  node_count: number;
  element_count: number;
  position_mm: Float64Array; /* [node][3], loaded */
  displacement_mm: Float64Array; /* [node][3]; unloaded = position - displacement */
  corners: Int32Array; /* [element][8], VTK order */
  tissue: Uint8Array; /* 0 muscle, 1 fat, 2 skin */
  E_shear: Float64Array; /* [element] */
  E_comp: Float64Array;
  cluster: Int32Array; /* [element]; 0: in none over both thresholds */
}

const header_bytes = 8;

function bytes_of(element: Element): DataView {
  if (element.getAttribute('format') !== 'binary') throw new Error('array is not base64');
  const text = atob((element.textContent ?? '').trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const view = new DataView(bytes.buffer);
  const count = Number(view.getBigUint64(0, true));
  if (count !== text.length - header_bytes) throw new Error('array is cut short');
  return new DataView(bytes.buffer, header_bytes);
}

function array_element(root: Document, name: string, type: string): Element {
  const found = root.querySelector(`DataArray[Name="${name}"]`);
  if (!found || found.getAttribute('type') !== type) throw new Error(`no ${type} array ${name}`);
  return found;
}

function float64(root: Document, name: string): Float64Array {
  const view = bytes_of(array_element(root, name, 'Float64'));
  return Float64Array.from({ length: view.byteLength / 8 }, (_, i) => view.getFloat64(8 * i, true));
}

function int32(root: Document, name: string): Int32Array {
  const view = bytes_of(array_element(root, name, 'Int32'));
  return Int32Array.from({ length: view.byteLength / 4 }, (_, i) => view.getInt32(4 * i, true));
}

function uint8(root: Document, name: string): Uint8Array {
  const view = bytes_of(array_element(root, name, 'UInt8'));
  return Uint8Array.from({ length: view.byteLength }, (_, i) => view.getUint8(i));
}

/* Throws an Error that says what is wrong with the text. */
export function read_vtu(text: string): Field {
  const root = new DOMParser().parseFromString(text, 'application/xml');
  const piece = root.querySelector('UnstructuredGrid > Piece');
  if (!piece) throw new Error('not a VTU file');
  const field: Field = {
    node_count: Number(piece.getAttribute('NumberOfPoints')),
    element_count: Number(piece.getAttribute('NumberOfCells')),
    position_mm: float64(root, 'Points'),
    displacement_mm: float64(root, 'displacement'),
    corners: int32(root, 'connectivity'),
    tissue: uint8(root, 'tissue'),
    E_shear: float64(root, 'E_shear'),
    E_comp: float64(root, 'E_comp'),
    cluster: int32(root, 'cluster'),
  };
  const fits =
    field.position_mm.length === 3 * field.node_count &&
    field.displacement_mm.length === 3 * field.node_count &&
    field.corners.length === 8 * field.element_count &&
    field.tissue.length === field.element_count;
  if (!fits) throw new Error('the arrays do not fit each other');
  return field;
}
