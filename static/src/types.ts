// SPDX-License-Identifier: GPL-3.0-or-later
//
// The documents of the HTTP contract, as far as this page reads them.

export type Side = 'left' | 'right';
export type Status = 'queued' | 'running' | 'succeeded' | 'failed' | 'cancelled';
export type Band = 'below' | 'shear' | 'compression' | 'both';

export interface Range {
  min: number;
  max: number;
}

export interface ParameterInfo {
  key: string;
  name: string;
  unit: string;
  description: string;
  accepted: Range;
  studied: Range;
  sd?: { max: number; typical: { absolute: number; relative: number } };
}

/* What the emulator says of one number: low to high is a 95 % band. */
export interface Estimated {
  value: number;
  low: number;
  high: number;
}

interface EstimatedGroups {
  strain: Record<'eps_max' | 'E_shear_max' | 'E_comp_max', Estimated | null> | null;
  clusters: Record<'shear' | 'compression' | 'both', { volume_mm3: Estimated | null }> | null;
  threshold_force_N: Record<'shear' | 'compression', Estimated | null> | null;
}

export interface Estimate extends EstimatedGroups {
  kind: 'estimate';
  emulator: { trial: boolean };
  warnings: FieldError[];
}

export interface WhatIfPoint extends EstimatedGroups {
  at: number;
  margin: Record<'shear' | 'compression', Estimated | null>;
}

export interface WhatIf {
  kind: 'what_if';
  parameter: string;
  unit: string;
  points: WhatIfPoint[];
  target_force_N: Record<'shear' | 'compression', Estimated | null> | null;
}

/* Values at 5, 25, 50, 75 and 95 %; null: not reached. */
export type Quantiles = (number | null)[];

export interface Uncertainty {
  status: 'given' | 'no_emulator' | 'other_model' | 'outside_training';
  typical: boolean;
  sd: Record<string, number>;
  trial: boolean;
  samples: number;
  inside: number;
  outside: Record<string, number>;
  strain: Record<'eps_max' | 'E_shear_max' | 'E_comp_max', Quantiles>;
  clusters: Record<'shear' | 'compression' | 'both', { volume_mm3: Quantiles }>;
  threshold_force_N: Record<'shear' | 'compression', Quantiles>;
  share_crossing: Record<'shear' | 'compression' | 'both', number | null>;
  sensitivity: Record<'first_order' | 'total', Record<string, number | null>>;
  model_form_error: { eps_max: number };
  checks: { eps_max: number | null; low: number; high: number }[];
}

export interface Cluster {
  volume_mm3: number;
  eps_max: number;
  E_shear_max: number;
  E_comp_max: number;
  centroid_mm: [number, number, number];
}

export interface ClusterSet {
  threshold?: number;
  volume_mm3: number;
  count: number;
  largest: Cluster | null;
}

export interface LoadPoint {
  F_N: number;
  displacement_mm: number;
  eps_max: number;
  E_shear_max: number;
  E_comp_max: number;
}

export interface Result {
  strain: { eps_max: number; eps_max_depth_mm: number; E_shear_max: number; E_comp_max: number };
  clusters: { shear: ClusterSet; compression: ClusterSet; both: ClusterSet };
  muscle_volume_mm3?: number;
  seat: {
    displacement_mm: number;
    contact_area_mm2: number;
    mean_pressure_kPa: number;
    peak_pressure_kPa: number;
  };
  load_curve: LoadPoint[];
  threshold_force_N: { shear: number | null; compression: number | null };
  risk: { band: Band; headline: string; reasons: string[]; caveats: string[] };
  numerics: {
    converged: boolean;
    elements: number;
    dof: number;
    load_steps: number;
    newton_iterations: number;
    force_residual: number;
    energy_residual: number;
    eps_max_error: number;
    wall_s: number;
    cpu_s: number;
  };
  model: { name: string; version: number };
  uncertainty?: Uncertainty;
}

export interface FieldError {
  pointer: string;
  code: string;
  detail: string;
}

export interface Problem {
  type?: string;
  title?: string;
  status?: number;
  detail?: string;
  errors?: FieldError[];
  reason?: string; /* why a load path ended */
  last_converged_fraction?: number; /* of the force */
}

export interface Assessment {
  id: string;
  status: Status;
  created_at: string;
  started_at?: string | null;
  finished_at?: string | null;
  subject?: string | null;
  side?: Side | null;
  label?: string | null;
  measured_at?: string | null;
  resolution?: string;
  sd?: 'typical' | Record<string, number> | null;
  skin?: Record<string, number> | null;
  model?: Record<string, number | string> | null; /* options, and the name of their set */
  parameters: Record<string, number>;
  progress: number;
  result?: Result | null;
  problem?: Problem | null;
  warnings?: FieldError[];
}

export interface ProgressEvent {
  fraction: number;
  load_step?: number;
  newton_iteration?: number;
  message?: string;
}
