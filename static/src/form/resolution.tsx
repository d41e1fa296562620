// SPDX-License-Identifier: GPL-3.0-or-later
import { t, t_or } from '../i18n.js';

/* The resolutions that the daemon offers and this page has a name for. */
export function Resolution(props: {
  names: string[];
  value: string;
  change: (name: string) => void;
}) {
  const known = props.names.filter((name) => t_or(`form.resolution.${name}`, '') !== '');
  if (known.length < 2) return null;
  return (
    <label>
      {t('form.resolution')}
      <select value={props.value} onChange={(e) => props.change(e.currentTarget.value)}>
        {known.map((name) => (
          <option key={name} value={name}>
            {t_or(`form.resolution.${name}`, name)}
          </option>
        ))}
      </select>
    </label>
  );
}
