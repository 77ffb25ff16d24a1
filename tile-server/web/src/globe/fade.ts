//! Pure cross-fade maths: how strong the old layer under a growing new one must be so that the pair's opacity never changes.

/**
 * Opacity of the old layer beneath a new one of opacity `upper`, such that together they cover as much as `whole` does:
 * upper + (1 - upper) * under = whole. Both are 0..1, `upper` at most `whole`. At whole = 1 the old layer simply stays until the end.
 */
export function underOpacity(whole: number, upper: number): number {
  if (upper >= whole) return 0;
  if (upper <= 0) return whole;
  return (whole - upper) / (1 - upper);
}
