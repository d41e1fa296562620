// SPDX-License-Identifier: GPL-3.0-or-later
//
// The geometry as entered, to scale. One half of the picture is the plane across the bone, where
// its radius is R1, the other half the plane along it, where it is R2: so a swap or a slip of the
// decimal mark in either is seen. Lengths inside are mm; z is up from the seat.
import { format, t } from '../i18n.js';

export interface Geometry {
  R1: number;
  R2: number;
  eM: number;
  eF: number;
  skin: number;
}

/* The frame that the studied sizes need; larger tissue shrinks the scale, and the bar with it. */
const frame_mm = { half_width: 48, height: 92 };
const px = { width: 300, height: 330, bottom: 24 };

/* Below this the picture would be a blot rather than a warning. */
const drawable = (g: Geometry): boolean =>
  [g.R1, g.R2, g.eM, g.eF].every((v) => Number.isFinite(v) && v > 0 && v < 2000);

interface Scale {
  k: number;
  x: (mm: number) => number;
  y: (mm: number) => number;
}

function scale_for(g: Geometry): Scale {
  const height = Math.max(frame_mm.height, (g.skin + g.eF + g.eM + 2 * g.R1) * 1.04);
  const half = Math.max(frame_mm.half_width, g.R1 * 1.2);
  const k = Math.min((px.height - px.bottom) / height, px.width / 2 / half);
  return { k, x: (mm) => px.width / 2 + mm * k, y: (mm) => px.height - px.bottom - mm * k };
}

/* Half of the bone across: the tube of radius R1 that lies on the muscle. */
function tube_path(s: Scale, tip: number, R1: number): string {
  const r = R1 * s.k;
  return `M${s.x(0)} ${s.y(tip)}A${r} ${r} 0 0 1 ${s.x(0)} ${s.y(tip + 2 * R1)}Z`;
}

/* Half of the bone along: the same tube bent to a ring whose centre line has the radius R2. */
function ring_path(s: Scale, tip: number, g: Geometry): string {
  const outer = (g.R2 + g.R1) * s.k;
  const inner = Math.max(0, g.R2 - g.R1) * s.k;
  const [x, bottom] = [s.x(0), s.y(tip)];
  const top = bottom - 2 * outer;
  const thick = outer - inner;
  return [
    `M${x} ${bottom}A${outer} ${outer} 0 0 0 ${x} ${top}`,
    `L${x} ${top + thick}A${inner} ${inner} 0 0 1 ${x} ${bottom - thick}Z`,
  ].join('');
}

function nice_bar(k: number): number {
  return [50, 20, 10, 5, 2, 1].find((mm) => mm * k <= 70) ?? 1;
}

function Layer(props: { s: Scale; from: number; to: number; name: string }) {
  const { s, from, to, name } = props;
  return (
    <rect
      class={`tissue ${name}`}
      x="0"
      width={px.width}
      y={s.y(to)}
      height={s.y(from) - s.y(to)}
    />
  );
}

/* A vertical dimension: line, two ticks, text. */
function Dimension(props: { s: Scale; from: number; to: number; at: number; text: string }) {
  const { s, from, to, at, text } = props;
  const [y0, y1] = [s.y(from), s.y(to)];
  const tall = y0 - y1 > 13;
  return (
    <g class="dimension">
      <path d={`M${at - 4} ${y0}h8M${at - 4} ${y1}h8M${at} ${y0}V${y1}`} />
      {tall && (
        <text x={at + 6} y={(y0 + y1) / 2 + 4}>
          {text}
        </text>
      )}
    </g>
  );
}

/* The two radii where they are: R1 of the tube, R2 of the ring's centre line. */
function Radii(props: { s: Scale; g: Geometry; tip: number }) {
  const { s, g, tip } = props;
  const [z_tube, z_ring] = [tip + g.R1, tip + g.R1 + g.R2];
  return (
    <g class="dimension">
      <path d={`M${s.x(0)} ${s.y(z_tube)}H${s.x(-g.R1)}m0 -4v8`} />
      <path d={`M${s.x(0)} ${s.y(z_ring)}H${s.x(g.R2)}m0 -4v8`} />
    </g>
  );
}

/* What one half shows, on a ground of its own: a large ring may pass under it. */
function Heading(props: { x: number; text: string; size: string }) {
  return (
    <text class="half end" x={props.x} y="14">
      {props.text}
      <tspan x={props.x} dy="13">
        {props.size}
      </tspan>
    </text>
  );
}

function Labels(props: { s: Scale; g: Geometry; tip: number; top: number }) {
  const { s, g, tip, top } = props;
  const interface_z = g.skin + g.eF;
  const bar = nice_bar(s.k);
  const y_seat = px.height - px.bottom;
  const x_skin = px.width * 0.3;
  return (
    <>
      <Dimension s={s} from={interface_z} to={tip} at={12} text={`eM ${format(g.eM)}`} />
      <Dimension s={s} from={g.skin} to={interface_z} at={12} text={`eF ${format(g.eF)}`} />
      <Heading x={px.width / 2 - 8} text={t('drawing.across')} size={`R1 ${format(g.R1)}`} />
      <Heading x={px.width - 8} text={t('drawing.along')} size={`R2 ${format(g.R2)}`} />
      <text
        class="end"
        x={px.width - 8}
        y={Math.max(s.y((interface_z + tip) / 2) + 4, s.y(top) + 14)}
      >
        {t('drawing.muscle')}
      </text>
      <text class="end" x={px.width - 8} y={s.y((g.skin + interface_z) / 2) + 4}>
        {t('drawing.fat')}
      </text>
      <path class="bar" d={`M${px.width - 8} ${y_seat + 11}v6h${-bar * s.k}v-6`} />
      <text class="end" x={px.width - 14 - bar * s.k} y={y_seat + 18}>{`${bar} mm`}</text>
      <text x="8" y={y_seat + 18}>
        {t('drawing.seat')}
      </text>
      <path class="leader" d={`M${x_skin - 4} ${y_seat + 14}V${s.y(g.skin / 2)}`} />
      <text x={x_skin} y={y_seat + 18}>{`${t('drawing.skin')} ${format(g.skin)}`}</text>
      <text x={s.x(0) + 8} y={s.y(tip + g.R1) + 4}>
        {t('drawing.bone')}
      </text>
    </>
  );
}

function Picture(props: { g: Geometry }) {
  const { g } = props;
  const s = scale_for(g);
  const tip = g.skin + g.eF + g.eM;
  const top = tip + g.R1;
  return (
    <>
      <Layer s={s} from={g.skin + g.eF} to={top} name="muscle" />
      <Layer s={s} from={g.skin} to={g.skin + g.eF} name="fat" />
      <Layer s={s} from={0} to={g.skin} name="skin" />
      <path class="bone" d={tube_path(s, tip, g.R1)} />
      <path class="bone" d={ring_path(s, tip, g)} />
      <path class="axis" d={`M${s.x(0)} 0V${s.y(0)}`} />
      <rect class="seat" x="0" width={px.width} y={s.y(0)} height="4" />
      <Radii s={s} g={g} tip={tip} />
      <Labels s={s} g={g} tip={tip} top={top} />
    </>
  );
}

export function Drawing(props: { geometry: Partial<Geometry>; skin: number; side: string }) {
  const g = { ...props.geometry, skin: props.skin } as Geometry;
  const ready = drawable(g);
  const text = ready
    ? t('drawing.text', { R1: g.R1, R2: g.R2, eM: g.eM, eF: g.eF })
    : t('drawing.waiting');
  return (
    <figure class="drawing">
      <figcaption class="visually-hidden">
        {`${t('drawing.title', { side: props.side })}. ${text}`}
      </figcaption>
      <svg viewBox={`0 0 ${px.width} ${px.height}`} aria-hidden="true">
        {ready && <Picture g={g} />}
      </svg>
      {!ready && <p class="waiting">{t('drawing.waiting')}</p>}
    </figure>
  );
}
