/* How the desired error dynamics ends, and what its origin is: verification/error_dynamics. */

/* Finite in time exactly for alpha < 1 and beta < alpha; not even exponential above 1. */
function classOf(alpha, beta) {
  const one = [1, 1];
  if (compare(alpha, one) < 0 && compare(beta, alpha) < 0) { return "finite-time"; }
  if (compare(alpha, one) <= 0 && compare(beta, alpha) <= 0) { return "exponential"; }
  return "asymptotic";
}

/* KD* = 2 KP^(1 - alpha/2) / ((2 - alpha) alpha^(alpha/2)): from here on a node. */
function criticalDamping(kp, alpha) {
  const a = value(alpha);
  return 2 * Math.pow(value(kp), 1 - a / 2) / ((2 - a) * Math.pow(a, a / 2));
}

/* KD = KD* exactly: both sides to the power 2 b, for alpha = a/b. */
function isCritical(kd, kp, alpha) {
  const [a, b] = alpha.map(BigInt);
  const [dn, dd] = kd.map(BigInt), [pn, pd] = kp.map(BigInt);
  const left = [dn * (2n * b - a), dd * 2n * b]; /* KD (2 - alpha)/2 */
  return left[0] ** (2n * b) * a ** a * pd ** (2n * b - a)
    === pn ** (2n * b - a) * left[1] ** (2n * b) * b ** a;
}

/* Whichever term is the smallest near the origin decides; for the pairs (35), the gains. */
function originOf(kd, kp, alpha, beta) {
  const order = compare(beta, finiteTimeBeta(alpha));
  if (order !== 0) { return order < 0 ? "focus" : "node"; }
  const excess = value(kd) / criticalDamping(kp, alpha) - 1;
  if (Math.abs(excess) < 1e-9 && isCritical(kd, kp, alpha)) { return "critical node"; }
  return excess > 0 ? "node" : "focus";
}
