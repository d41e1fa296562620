// SPDX-License-Identifier: GPL-3.0-or-later
declare module 'table2:inputs' {
  const csv: string;
  export default csv;
}
declare module 'table2:results' {
  import type { ReferenceSet } from './reference.js';
  const results: ReferenceSet | null;
  export default results;
}
