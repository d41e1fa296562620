// SPDX-License-Identifier: GPL-3.0-or-later
//
// What the page and the 3-D bundle agree on; types only, so that neither pulls in the other.

export interface ColourStop {
  value: number;
  rgb: readonly [number, number, number];
}

export type Criterion = 'both' | 'shear' | 'compression';

export interface Thresholds {
  shear: number;
  compression: number;
}

export interface SceneState {
  colour: 'E_shear' | 'E_comp' | null; /* null: plain tissue */
  stops: ColourStop[];
  cut: boolean;
  bodies: Criterion | null; /* only the muscle over it, as solid bodies; null: the tissue */
  bone: boolean;
  seat: boolean;
  scale: number; /* of the displacement: 1 as solved, 0 unloaded */
}

export interface Scene {
  show(state: SceneState): void;
  reset_view(): void;
  turn(azimuth_degrees: number, elevation_degrees: number): void;
  zoom(factor: number): void;
  picture(): Promise<Blob>;
  dispose(): void;
}

export interface SceneModule {
  /* Throws an Error that says why when the field cannot be read or drawn. */
  create_scene(container: HTMLElement, vtu: string, thresholds: Thresholds): Scene;
}
