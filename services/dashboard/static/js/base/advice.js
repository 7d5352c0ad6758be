// Advice in the reader's language.

import { t } from "./words.js";

/** What stands in brackets behind the advice comes from the case, and stays as it is. */
export function adviceWords(advice) {
  const [, known, detail] = advice.match(/^(.*?)( \(.*\))?$/s);
  return `${t(known)}${detail ?? ""}`;
}
