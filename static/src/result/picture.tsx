// SPDX-License-Identifier: GPL-3.0-or-later
//
// The loaded tissue: the section that the daemon drew, and the 3-D view for those who ask for it.
import { useState } from 'preact/hooks';
import { section_path } from '../api.js';
import { t } from '../i18n.js';
import { View3d } from '../view3d/view3d.js';
import type { Finished } from './quantities.js';

export function Picture(props: { of: Finished; side: string }) {
  const [in_3d, set_3d] = useState(false);
  const { of, side } = props;
  return (
    <figure class="picture">
      <figcaption>
        <span>{t('picture.title')}</span>
        <span class="switch" role="group" aria-label={t('picture.tabs', { side })}>
          <button type="button" aria-pressed={!in_3d} onClick={() => set_3d(false)}>
            {t('picture.section')}
          </button>
          <button type="button" aria-pressed={in_3d} onClick={() => set_3d(true)}>
            {t('picture.3d')}
          </button>
        </span>
      </figcaption>
      {in_3d ? (
        <View3d of={of} side={side} on_section={() => set_3d(false)} />
      ) : (
        <img src={section_path(of.id)} alt={t('picture.alt', { side })} />
      )}
    </figure>
  );
}
