//! Closed lists of words, in the order in which the server offers them.
export { modeValues as MODES, platformKindValues as KINDS, qualityValues as QUALITIES } from "./schema";
