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
const frame_mm = { half_width: 66, height: 84 };
const px = { width: 300, height: 236, bottom: 24 };

/* Below this the picture would be a blot rather than a warning. */
const drawable = (g: Geometry): boolean =>
  [g.R1, g.R2, g.eM, g.eF].every((v) => Number.isFinite(v) && v > 0 && v < 2000);

interface Scale {
  k: number;
  x: (mm: number) => number;
  y: (mm: number) => number;
}

function scale_for(g: Geometry): Scale {
  const height = Math.max(frame_mm.height, (g.skin + g.eF + g.eM + g.R1) * 1.04);
  const half = Math.max(frame_mm.half_width, g.R1 * 1.2);
  const k = Math.min((px.height - px.bottom) / height, px.width / 2 / half);
  return { k, x: (mm) => px.width / 2 + mm * k, y: (mm) => px.height - px.bottom - mm * k };
}

/* Half outline of the bone below the top of the tissue, from the tip outwards and up. `radius` is
 * that of the surface in this plane; `sign` the side of the axis. */
function bone_path(s: Scale, tip: number, radius: number, top: number, sign: 1 | -1): string {
  const rise = Math.min(top - tip, radius);
  const reach = Math.sqrt(Math.max(0, radius * radius - (radius - rise) ** 2));
  const r = radius * s.k;
  const sweep = sign > 0 ? 0 : 1;
  return [
    `M${s.x(0)} ${s.y(tip)}`,
    `A${r} ${r} 0 0 ${sweep} ${s.x(sign * reach)} ${s.y(tip + rise)}`,
    `L${s.x(sign * reach)} ${s.y(top)}`,
    `L${s.x(0)} ${s.y(top)}Z`,
  ].join('');
}

function nice_bar(k: number): number {
  return [50, 20, 10, 5, 2, 1].find((mm) => mm * k <= 70) ?? 1;
}

function Layer(props: { s: Scale; from: number; to: number; name: string }) {
  const { s, from, to, name } = props;
  return (
    <rect class={`tissue ${name}`} x="0" width={px.width} y={s.y(to)} height={s.y(from) - s.y(to)} />
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

function Labels(props: { s: Scale; g: Geometry; tip: number; top: number }) {
  const { s, g, tip, top } = props;
  const interface_z = g.skin + g.eF;
  const bar = nice_bar(s.k);
  const y_seat = px.height - px.bottom;
  return (
    <>
      <Dimension s={s} from={interface_z} to={tip} at={12} text={`eM ${format(g.eM)}`} />
      <Dimension s={s} from={g.skin} to={interface_z} at={12} text={`eF ${format(g.eF)}`} />
      <text class="half" x="8" y="12">
        {t('drawing.across')}
      </text>
      <text class="half end" x={px.width - 8} y="12">
        {t('drawing.along')}
      </text>
      <text class="end" x={px.width - 8} y={Math.max(s.y((interface_z + tip) / 2) + 4, s.y(top) + 14)}>
        {t('drawing.muscle')}
      </text>
      <text class="end" x={px.width - 8} y={s.y((g.skin + interface_z) / 2) + 4}>
        {t('drawing.fat')}
      </text>
      <text class="on_bone end" x={px.width / 2 - 5} y={s.y(top) - 5}>
        {`R1 ${format(g.R1)}`}
      </text>
      <text class="on_bone" x={px.width / 2 + 5} y={s.y(top) - 5}>
        {`R2 ${format(g.R2)}`}
      </text>
      <path class="bar" d={`M${px.width - 8} ${y_seat + 11}v6h${-bar * s.k}v-6`} />
      <text class="end" x={px.width - 14 - bar * s.k} y={y_seat + 18}>{`${bar} mm`}</text>
      <text x="8" y={y_seat + 18}>
        {t('drawing.seat')}
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
      <path class="bone" d={bone_path(s, tip, g.R1, top, -1)} />
      <path class="bone" d={bone_path(s, tip, g.R2 + g.R1, top, 1)} />
      <path class="axis" d={`M${s.x(0)} ${s.y(top)}V${s.y(0)}`} />
      <rect class="seat" x="0" width={px.width} y={s.y(0)} height="4" />
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
