/* Exact numbers: a fraction is [numerator, denominator], both whole, the denominator above 0. */
function divisor(a, b) { return b ? divisor(b, a % b) : Math.abs(a); }
function fraction(n, d) { const g = divisor(n, d) || 1; return [n / g, d / g]; }
function value([n, d]) { return n / d; }
function compare([a, b], [c, d]) { return Math.sign(a * d - c * b); }
function same(x, y) { return compare(x, y) === 0; }

/* beta = alpha/(2 - alpha) (35) */
function finiteTimeBeta([n, d]) { return fraction(n, 2 * d - n); }

/* An exponent as the C takes it: a - 1 in Q31, rounded to nearest, ties to even; below 2. */
function exponentQ31([n, d]) {
  const numerator = BigInt(n - d) << 31n, denominator = BigInt(d);
  let floor = numerator / denominator;
  if (floor * denominator > numerator) { floor -= 1n; }
  const twice = 2n * (numerator - floor * denominator);
  if (twice > denominator || (twice === denominator && floor & 1n)) { floor += 1n; }
  return Number(floor > 2147483647n ? 2147483647n : floor);
}
