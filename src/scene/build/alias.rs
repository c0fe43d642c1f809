//! Alias tables (Walker 1977; construction after Vose 1991) in integer arithmetic: what a table returns is known
//! exactly, so the probability that an estimator divides by is the one that the kernel draws with.
use crate::layout::AliasEntry;

/// Units of probability that one slot holds.
const SLOT: u64 = 1 << 32;

/// The table over `weights` (finite, not negative), same length. All zero weights become uniform; any positive weight
/// keeps a positive probability, however small.
pub fn build(weights: &[f64]) -> Vec<AliasEntry> {
    let mut units = units(weights);
    let mut table = vec![AliasEntry { threshold: u32::MAX, alias: 0, ..Default::default() }; units.len()];
    let (mut small, mut large): (Vec<u32>, Vec<u32>) = (0..units.len() as u32).partition(|&i| units[i as usize] < SLOT);
    while let (Some(i), Some(&donor)) = (small.pop(), large.last()) {
        // A threshold of 2^32 - 1 would read as "always stays", so the entry gives up one unit.
        let kept = units[i as usize].min(SLOT - 2);
        table[i as usize] = AliasEntry { threshold: kept as u32, alias: donor, ..Default::default() };
        let left = &mut units[donor as usize];
        *left = (*left + kept).saturating_sub(SLOT);
        if *left < SLOT {
            large.pop();
            small.push(donor);
        }
    }
    for (i, entry) in table.iter_mut().enumerate().filter(|(_, e)| e.threshold == u32::MAX) {
        entry.alias = i as u32;
    }
    table
}

/// Weights as integers that sum to `n * 2^32` exactly; the largest takes up what rounding left over.
fn units(weights: &[f64]) -> Vec<u64> {
    let total: f64 = weights.iter().sum();
    if weights.is_empty() || total <= 0.0 {
        return vec![SLOT; weights.len()];
    }
    let whole = weights.len() as u64 * SLOT;
    let scale = whole as f64 / total;
    let mut units: Vec<u64> = weights.iter().map(|&w| if w > 0.0 { ((w * scale) as u64).max(1) } else { 0 }).collect();
    let sum: u64 = units.iter().sum();
    let largest = (0..units.len()).max_by_key(|&i| units[i]).unwrap_or(0);
    units[largest] = (units[largest] + whole).saturating_sub(sum);
    units
}

/// The exact probability of every entry: the sum of its shares over the table, in units of 2^-32 of a slot.
pub fn probabilities(table: &[AliasEntry]) -> Vec<f64> {
    let mut units = vec![0u64; table.len()];
    for (i, entry) in table.iter().enumerate() {
        let kept = if entry.threshold == u32::MAX { SLOT } else { u64::from(entry.threshold) };
        units[i] += kept;
        units[entry.alias as usize] += SLOT - kept;
    }
    let whole = table.len() as f64 * SLOT as f64;
    units.into_iter().map(|u| u as f64 / whole).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::pcg;
    use crate::twins::light::alias_choose;

    #[test]
    fn the_worked_example_is_exact() {
        // Quarters over four slots: 1/8, 1/8, 1/4, 1/2 are whole numbers of units, so nothing is rounded.
        let table = build(&[1.0, 1.0, 2.0, 4.0]);
        assert_eq!(probabilities(&table), [0.125, 0.125, 0.25, 0.5]);
        // Control: a table that forgets its aliases is told apart.
        let broken: Vec<_> = table.iter().map(|e| AliasEntry { alias: 0, ..*e }).collect();
        assert_ne!(probabilities(&broken), [0.125, 0.125, 0.25, 0.5]);
    }

    #[test]
    fn probabilities_sum_to_one_and_follow_the_weights() {
        let weights: Vec<f64> = (0..1000).map(|i| f64::from((i * 7919) % 1013) * 1e-3).collect();
        let found = probabilities(&build(&weights));
        let total: f64 = weights.iter().sum();
        assert_eq!(found.iter().sum::<f64>(), 1.0);
        for (p, w) in found.iter().zip(&weights) {
            // A unit is 2^-32 of a slot; rounding moves an entry by at most two, the largest by one per entry.
            assert!((p - w / total).abs() < 1e3 / (1000.0 * 4294967296.0), "{p} against {}", w / total);
            assert_eq!(*p == 0.0, *w == 0.0);
        }
    }

    #[test]
    fn extreme_weights_keep_a_chance() {
        let found = probabilities(&build(&[1e-30, 1.0, 0.0, 1e30]));
        assert!(found[0] > 0.0 && found[1] > 0.0 && found[2] == 0.0);
        assert_eq!(probabilities(&build(&[0.0, 0.0])), [0.5, 0.5]);
        assert!(build(&[]).is_empty());
        assert_eq!(probabilities(&build(&[3.0])), [1.0]);
    }

    /// A sun among 2^20 texels, of which each other one keeps a 16,384th of its slot, while a word takes but 4096 steps there.
    #[test]
    fn dim_texels_of_a_large_sky_are_drawn_as_seldom_as_claimed() {
        const TEXELS: usize = 1 << 20;
        const SMALL: u32 = 1 << 14;
        let mut weights = vec![1.0; TEXELS];
        weights[77] = TEXELS as f64 * f64::from(SMALL);
        let table = build(&weights);
        let count = 1 << 22;
        let expected = (1.0 - probabilities(&table)[77]) * f64::from(count);
        assert!((expected - f64::from(count / SMALL)).abs() < 1.0, "{expected}");
        let dim = (0..count).filter(|&i| alias_choose(&table, pcg(i)).0 != 77).count() as f64;
        assert!((dim - expected).abs() < 5.0 * expected.sqrt(), "{dim} of {count}, expected {expected}");
    }
}
