// SPDX-License-Identifier: GPL-3.0-or-later
//
// The 3-D view with its controls. The drawing itself is in another bundle, loaded here on demand.
import { useEffect, useRef, useState } from 'preact/hooks';
import { field_path, section_path } from '../api.js';
import { format, format_fixed, t } from '../i18n.js';
import type { Finished } from '../result/quantities.js';
import type { LoadPoint } from '../types.js';
import { save_file } from '../ui.js';
import { colour_stops, css_colour } from './colours.js';
import type { Criterion, Scene, SceneModule, SceneState, Thresholds } from './contract.js';

const bundle = '/assets/view3d.js';
const turn_degrees = 8;

interface Controls {
  colour: 'E_shear' | 'E_comp';
  cut: boolean;
  bodies: Criterion | null;
  bone: boolean;
  seat: boolean;
  step: number; /* index into the load path */
}

function has_webgl(): boolean {
  const canvas = document.createElement('canvas');
  return !!(canvas.getContext('webgl2') ?? canvas.getContext('webgl'));
}

/* The load path from nothing to full, whether or not the document lists its beginning. */
function path_of(of: Finished): LoadPoint[] {
  const start: LoadPoint = {
    F_N: 0,
    displacement_mm: 0,
    eps_max: 0,
    E_shear_max: 0,
    E_comp_max: 0,
  };
  return [start, ...of.result.load_curve.filter((p) => p.F_N > 0)];
}

function thresholds_of(of: Finished): Thresholds {
  const { shear, compression } = of.result.clusters;
  return { shear: shear.threshold ?? 0.75, compression: compression.threshold ?? 0.45 };
}

/* The same scale for every side, so that two can be compared; shear ends where the section's does. */
function scale_range(of: Finished, colour: Controls['colour']): { threshold: number; max: number } {
  const { shear, compression } = thresholds_of(of);
  return colour === 'E_comp' ? { threshold: compression, max: 0.5 } : { threshold: shear, max: 2 };
}

function scene_state(of: Finished, c: Controls): SceneState {
  const path = path_of(of);
  const last = path[path.length - 1]?.displacement_mm ?? 0;
  const travel = path[c.step]?.displacement_mm ?? 0;
  const full = c.step === path.length - 1;
  const { threshold, max } = scale_range(of, c.colour);
  return {
    colour: full ? c.colour : null,
    stops: colour_stops(threshold, max),
    cut: c.cut,
    bodies: full ? c.bodies : null,
    bone: c.bone,
    seat: c.seat,
    scale: last > 0 ? travel / last : 1,
  };
}

async function load(container: HTMLElement, of: Finished): Promise<Scene> {
  const [module, response] = await Promise.all([
    import(/* @vite-ignore */ bundle) as Promise<SceneModule>,
    fetch(field_path(of.id)),
  ]);
  if (!response.ok) throw new Error(`HTTP ${response.status}`);
  return module.create_scene(container, await response.text(), thresholds_of(of));
}

type Stage = { is: 'loading' | 'ready' | 'no_webgl' } | { is: 'failed'; detail: string };

function use_scene(of: Finished, state: SceneState) {
  const container = useRef<HTMLDivElement>(null);
  const scene = useRef<Scene | null>(null);
  const [stage, set_stage] = useState<Stage>({ is: 'loading' });
  useEffect(() => {
    if (!has_webgl()) return set_stage({ is: 'no_webgl' });
    let wanted = true;
    load(container.current as HTMLElement, of).then(
      (made) => {
        if (!wanted) return made.dispose();
        scene.current = made;
        set_stage({ is: 'ready' });
        made.show(state);
        made.reset_view();
      },
      (e: unknown) =>
        wanted && set_stage({ is: 'failed', detail: String(e instanceof Error ? e.message : e) }),
    );
    return () => {
      wanted = false;
      scene.current?.dispose();
      scene.current = null;
    };
  }, [of.id]);
  useEffect(() => scene.current?.show(state), [JSON.stringify(state)]);
  return { container, scene, stage };
}

function Legend(props: { of: Finished; colour: Controls['colour'] }) {
  const { threshold, max } = scale_range(props.of, props.colour);
  const id = `scale-${props.of.id}-${props.colour}`;
  const x = (v: number): number => 10 + (v / max) * 280;
  return (
    <svg class="legend" viewBox="0 0 300 34" aria-hidden="true">
      <defs>
        <linearGradient id={id}>
          {colour_stops(threshold, max).map((s) => (
            <stop key={s.value} offset={s.value / max} stop-color={css_colour(s)} />
          ))}
        </linearGradient>
      </defs>
      <rect x="10" y="2" width="280" height="12" fill={`url(#${id})`} />
      <path d={`M${x(threshold)} 0v17`} />
      <text x="10" y="28">
        0
      </text>
      <text x={Math.min(x(threshold), 232)} y="28" text-anchor="middle">
        {t('view.threshold', { value: threshold })}
      </text>
      <text x="290" y="28" text-anchor="end">
        {max < 1 ? format(max) : t('view.above', { value: max })}
      </text>
    </svg>
  );
}

function Check(props: { label: string; on: boolean; change: (on: boolean) => void }) {
  return (
    <label class="check">
      <input
        type="checkbox"
        checked={props.on}
        onChange={(e) => props.change(e.currentTarget.checked)}
      />
      {props.label}
    </label>
  );
}

const criteria: readonly Criterion[] = ['both', 'shear', 'compression'];

function Bodies(props: {
  of: Finished;
  shown: Criterion | null;
  change: (shown: Criterion | null) => void;
}) {
  const { shown } = props;
  const nothing = shown !== null && props.of.result.clusters[shown].volume_mm3 <= 0;
  const id = `show-${props.of.id}`;
  return (
    <>
      <label for={id}>{t('view.show')}</label>
      <select
        id={id}
        value={shown ?? ''}
        onChange={(e) => props.change((e.currentTarget.value || null) as Criterion | null)}
      >
        <option value="">{t('view.show.tissue')}</option>
        {criteria.map((name) => (
          <option key={name} value={name}>
            {t(`view.show.${name}`)}
          </option>
        ))}
      </select>
      <span role="status" class="hint">
        {nothing && t('view.show.none')}
      </span>
    </>
  );
}

function LoadSlider(props: { of: Finished; step: number; change: (step: number) => void }) {
  const path = path_of(props.of);
  const point = path[props.step];
  const text = point
    ? t('view.load.at', {
        force: format_fixed(point.F_N, 0),
        travel: format_fixed(point.displacement_mm, 1),
        shear: format_fixed(point.E_shear_max, 2),
        comp: format_fixed(point.E_comp_max, 2),
      })
    : '';
  const id = `load-${props.of.id}`;
  return (
    <div class="load">
      <label for={id}>{t('view.load')}</label>
      <input
        id={id}
        type="range"
        min={0}
        max={path.length - 1}
        step={1}
        value={props.step}
        aria-valuetext={text}
        onInput={(e) => props.change(Number(e.currentTarget.value))}
      />
      <output for={id}>{text}</output>
      {props.step < path.length - 1 && <p class="hint">{t('view.load.partial')}</p>}
    </div>
  );
}

function save(scene: Scene, id: string): void {
  void scene.picture().then((blob) => save_file(blob, `ischia-${id}.png`));
}

const keys: Record<string, (scene: Scene) => void> = {
  ArrowLeft: (s) => s.turn(turn_degrees, 0),
  ArrowRight: (s) => s.turn(-turn_degrees, 0),
  ArrowUp: (s) => s.turn(0, -turn_degrees),
  ArrowDown: (s) => s.turn(0, turn_degrees),
  '+': (s) => s.zoom(1.15),
  '-': (s) => s.zoom(1 / 1.15),
};

export function View3d(props: { of: Finished; side: string; on_section: () => void }) {
  const { of } = props;
  const [c, set] = useState<Controls>({
    colour: 'E_shear',
    cut: true,
    bodies: null,
    bone: true,
    seat: true,
    step: path_of(of).length - 1,
  });
  const change = (part: Partial<Controls>): void => set((now) => ({ ...now, ...part }));
  const { container, scene, stage } = use_scene(of, scene_state(of, c));

  if (stage.is === 'no_webgl' || stage.is === 'failed') {
    const text =
      stage.is === 'failed' ? t('view.failed', { detail: stage.detail }) : t('view.no_webgl');
    return (
      <>
        <p class="hint" role="status">
          {text}
        </p>
        <img src={section_path(of.id)} alt={t('picture.alt', { side: props.side })} />
      </>
    );
  }

  const on_key = (e: KeyboardEvent): void => {
    const act = keys[e.key];
    if (!act || !scene.current) return;
    e.preventDefault();
    act(scene.current);
  };

  return (
    <div class="view3d">
      {stage.is === 'loading' && (
        <p class="loading" role="status">
          {t('view.loading')}
        </p>
      )}
      <div
        class="canvas"
        ref={container}
        role="application"
        tabIndex={0}
        aria-label={t('view.alt', { side: props.side })}
        onKeyDown={on_key}
      />
      <Legend of={of} colour={c.colour} />
      <LoadSlider of={of} step={c.step} change={(step) => change({ step })} />
      <div class="controls">
        <label>
          {t('view.colour')}{' '}
          <select
            value={c.colour}
            onChange={(e) => change({ colour: e.currentTarget.value as Controls['colour'] })}
          >
            <option value="E_shear">{t('view.colour.shear')}</option>
            <option value="E_comp">{t('view.colour.comp')}</option>
          </select>
        </label>
        <Check label={t('view.cut')} on={c.cut} change={(cut) => change({ cut })} />
        <Bodies of={of} shown={c.bodies} change={(bodies) => change({ bodies })} />
        <Check label={t('view.bone')} on={c.bone} change={(bone) => change({ bone })} />
        <Check label={t('view.seat')} on={c.seat} change={(seat) => change({ seat })} />
        <button type="button" onClick={() => scene.current?.reset_view()}>
          {t('view.reset')}
        </button>
        <button type="button" onClick={() => scene.current && save(scene.current, of.id)}>
          {t('view.screenshot')}
        </button>
      </div>
    </div>
  );
}
