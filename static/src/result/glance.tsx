// SPDX-License-Identifier: GPL-3.0-or-later
//
// The answer at a glance: which thresholds are crossed, in how much muscle, where, and from which
// force on. Words and shapes; colour repeats them.
import { format_fixed, format_percent, t } from '../i18n.js';
import type { ClusterSet, Result } from '../types.js';
import { Shape } from '../ui.js';
import { given, interval_text } from './interval.js';
import { share_of_muscle, tip_height, type Finished } from './quantities.js';

function Force(props: { from: number | null; F: number }) {
  const { from, F } = props;
  if (from === null) return <>{t('glance.never', { F })}</>;
  const force = format_fixed(from, 0);
  return <>{t('glance.from', { force, percent: format_percent(from / F), F })}</>;
}

function bodies(set: ClusterSet): string {
  return set.count === 1 ? t('glance.bodies.one') : t('glance.bodies', { n: set.count });
}

function Volume(props: { set: ClusterSet; result: Result }) {
  const { set, result } = props;
  if (set.volume_mm3 <= 0) return <span class="none">{t('glance.nowhere')}</span>;
  const share = share_of_muscle(result, set.volume_mm3);
  return (
    <>
      <strong>{`${format_fixed(set.volume_mm3, 0)}\u00a0mm³`}</strong>
      {share !== null && `, ${t('glance.of_muscle', { percent: format_percent(share) })}`}
    </>
  );
}

function Where(props: { set: ClusterSet; tip: number }) {
  const { set, tip } = props;
  if (!set.largest) return null;
  const below = tip - set.largest.centroid_mm[2];
  const depth = format_fixed(Math.abs(below), 1);
  const where = t(below < 0 ? 'glance.where.above' : 'glance.where', { depth });
  return <span class="more">{`${bodies(set)}, ${where}`}</span>;
}

/* What the uncertain measurements leave open. */
function Between(props: { text: string }) {
  return props.text ? <span class="more between">{props.text}</span> : null;
}

export function Glance(props: { of: Finished; skin_mm: number }) {
  const { result, parameters } = props.of;
  const { clusters, strain, numerics, threshold_force_N: force } = result;
  const { band } = result.risk;
  const u = given(result);
  const F = parameters['F'] ?? 0;
  const tip = tip_height(props.of, props.skin_mm);
  return (
    <div class={`glance ${band}`}>
      <p class="verdict">
        <Shape of={band} />
        <strong>{t(`band.${band}`)}</strong>
      </p>
      <dl>
        <dt>{t('glance.shear', { threshold: clusters.shear.threshold ?? '' })}</dt>
        <dd>
          <Volume set={clusters.shear} result={result} />
          <Between text={interval_text(u?.clusters.shear.volume_mm3, 0, '\u00a0mm³')} />
          <span class="more">
            <Force from={force.shear} F={F} />
          </span>
          {band !== 'both' && <Where set={clusters.shear} tip={tip} />}
        </dd>
        <dt>{t('glance.compression', { threshold: clusters.compression.threshold ?? '' })}</dt>
        <dd>
          <Volume set={clusters.compression} result={result} />
          <Between text={interval_text(u?.clusters.compression.volume_mm3, 0, '\u00a0mm³')} />
          <span class="more">
            <Force from={force.compression} F={F} />
          </span>
          {band !== 'both' && <Where set={clusters.compression} tip={tip} />}
        </dd>
        <dt>{t('glance.both')}</dt>
        <dd>
          <Volume set={clusters.both} result={result} />
          <Between text={interval_text(u?.clusters.both.volume_mm3, 0, '\u00a0mm³')} />
          <Where set={clusters.both} tip={tip} />
        </dd>
        <dt>{t('glance.axis')}</dt>
        <dd>
          <strong>{format_fixed(strain.eps_max, 3)}</strong>{' '}
          {t('glance.axis.error', { error: format_fixed(numerics.eps_max_error, 3) })}
          <span class="more">
            {t('glance.axis.depth', { depth: format_fixed(strain.eps_max_depth_mm, 1) })}
          </span>
          <Between text={interval_text(u?.strain.eps_max, 3)} />
        </dd>
      </dl>
    </div>
  );
}
