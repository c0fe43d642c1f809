//! Twins of the kernels of `glsl/apportion` and of `choose.comp`, written plainly with 128-bit products and a sort. Their
//! results equal the kernels' exactly.
use crate::layout::NONE;
use crate::math::hash::pcg;
use crate::shaders::lack::INITIAL_SAMPLES;
use crate::shaders::quantise_priority::{FIXED_POINT, MAX_PRIORITY};
use crate::shaders::shared::start_apportionment::PARTS;

/// Priorities as 12.20 fixed point, and the number of those that are not finite, whose weight is 0.
pub fn weigh(priority: &[f32]) -> (Vec<u32>, u32) {
    let weight = |p: &f32| if p.is_finite() && *p > 0.0 { (p.min(MAX_PRIORITY) * FIXED_POINT) as u32 } else { 0 };
    let broken = priority.iter().filter(|p| !p.is_finite()).count();
    (priority.iter().map(weight).collect(), broken as u32)
}

/// One sample or none for every pixel, in a round: where the priority reaches the threshold, or, without one, by chance.
pub fn choose(priority: &[f32], round: u32, seed: u32, threshold: f32) -> Vec<u32> {
    let chosen = |(i, &p): (usize, &f32)| match threshold > 0.0 {
        true => p >= threshold,
        false => {
            f64::from(pcg(pcg(i as u32 ^ pcg(seed)).wrapping_add(round))) < (f64::from(p) * 4_294_967_296.0).floor()
        }
    };
    priority.iter().enumerate().map(chosen).map(u32::from).collect()
}

/// What pixels lack of their shares of `total` samples, in [`PARTS`] of a sample: max(0, floor(PARTS total w / W) - PARTS have).
pub fn deficit(weights: &[u32], have: &[u32], total: u64) -> Vec<u32> {
    let sum: u128 = weights.iter().map(|&w| u128::from(w)).sum();
    let parts = |samples: u128| u128::from(PARTS) * samples;
    let share = |w: u32| match sum {
        0 => parts(total.into()) / weights.len() as u128,
        sum => parts(total.into()) * u128::from(w) / sum,
    };
    let lack = |(&w, &have): (&u32, &u32)| share(w).saturating_sub(parts(have.into())).min(u128::from(u32::MAX)) as u32;
    weights.iter().zip(have).map(lack).collect()
}

/// Samples that pixels lack until weight / sqrt(n) reaches the threshold, both 12.20 fixed point:
/// ceil((w / t)^2) - have, at least 1 and at most max(have, `INITIAL_SAMPLES`) and what is left of `enough`; 0 of a weight of 0.
pub fn need(weights: &[u32], have: &[u32], threshold: u32, enough: u32) -> Vec<u32> {
    let lack = |(&w, &have): (&u32, &u32)| {
        let wanted = (u64::from(w) * u64::from(w)).div_ceil(u64::from(threshold) * u64::from(threshold));
        let most = have.max(INITIAL_SAMPLES).min(enough.saturating_sub(have));
        let lacks = wanted.saturating_sub(u64::from(have)).clamp(1, 1 << 31) as u32;
        if w == 0 { 0 } else { lacks.min(most) }
    };
    weights.iter().zip(have).map(lack).collect()
}

/// Hamilton's method with limited room. Quotas are in proportion to the weights, rounded down. Pixels whose quota is no less
/// than their room get the room, and the rest is apportioned again among the others, up to `repetitions` times in all. Then the
/// largest remainders get one more, ties at the lower index first. If all open pixels have weight 0, they share alike. If the
/// repetitions were too few, what is left fills the room in order of index. The counts sum to the smaller of budget and room.
pub fn apportion(weights: &[u32], room: &[u32], budget: u64, repetitions: u32) -> Vec<u32> {
    let mut count = vec![0_u32; weights.len()];
    let mut open: Vec<usize> = (0..weights.len()).collect();
    let mut left = u128::from(budget);
    let mut equal = weights.iter().all(|&w| w == 0);
    for repetition in 0.. {
        let weight = |i: usize| u128::from(if equal { 1 } else { weights[i] });
        let sum = open.iter().map(|&i| weight(i)).sum::<u128>().max(1);
        let (full, rest): (Vec<_>, Vec<_>) = open.iter().partition(|&&i| left * weight(i) / sum >= u128::from(room[i]));
        let keys: Vec<_> = rest.iter().map(|&i: &usize| (left * weight(i) % sum, i)).collect();
        rest.iter().for_each(|&i| count[i] = (left * weight(i) / sum) as u32);
        full.iter().for_each(|&i: &usize| count[i] = room[i]);
        let filled: u128 = full.iter().map(|&i| u128::from(room[i])).sum();
        open = rest;
        if full.is_empty() || repetition + 1 == repetitions {
            let floors: u128 = open.iter().map(|&i| u128::from(count[i])).sum();
            let beyond = (left - filled - floors) as u64;
            match full.is_empty() {
                true => largest_remainders(&mut count, keys, beyond),
                false => fill_room(&mut count, room, &open, beyond),
            }
            return count;
        }
        left -= filled;
        equal = equal || open.iter().all(|&i| weights[i] == 0);
    }
    count
}

fn largest_remainders(count: &mut [u32], mut keys: Vec<(u128, usize)>, beyond: u64) {
    keys.sort_by_key(|&(key, i)| (std::cmp::Reverse(key), i));
    keys.iter().take(beyond as usize).for_each(|&(_, i)| count[i] += 1);
}

fn fill_room(count: &mut [u32], room: &[u32], open: &[usize], mut beyond: u64) {
    for &i in open {
        let taken = beyond.min(u64::from(room[i] - count[i]));
        count[i] += taken as u32;
        beyond -= taken;
    }
}

/// Index of every pixel's first path; last, the number of all paths.
pub fn offsets(count: &[u32]) -> Vec<u64> {
    let mut offsets = vec![0];
    for &n in count {
        offsets.push(offsets[offsets.len() - 1] + u64::from(n));
    }
    offsets
}

/// [`offsets`] within round `round` of `rounds`, to which the list of all paths is dealt: path j goes to round j mod `rounds`.
pub fn dealt(offsets: &[u64], round: u32, rounds: u32) -> Vec<u64> {
    offsets.iter().map(|o| (o + u64::from(rounds - 1 - round)) / u64::from(rounds)).collect()
}

/// (pixel, sample index) of paths `first .. first + paths`; `next` are the pixels' next samples before the batch.
pub fn batch(offsets: &[u64], next: &[u32], first: u64, paths: u32) -> Vec<[u32; 2]> {
    let mut list = vec![[NONE; 2]; paths as usize];
    for (i, range) in offsets.windows(2).enumerate() {
        let (low, high) = (range[0].max(first), range[1].min(first + u64::from(paths)));
        for at in low..high.max(low) {
            list[(at - first) as usize] = [i as u32, next[i] + (at - low) as u32];
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: [u32; 4] = [1000; 4];

    /// Rounds of one sample in all give each pixel one, and weights of nearly one size as many to all.
    #[test]
    fn small_rounds_are_spread_as_weights_say() {
        let (mut have, room) = ([1; 64], [u32::MAX; 64]);
        for total in 65..=128 {
            let next = apportion(&deficit(&[1 << 20; 64], &have, total), &room, 1, 1);
            have.iter_mut().zip(next).for_each(|(have, next)| *have += next);
        }
        assert_eq!(have, [2; 64]);
        let uneven: Vec<u32> = (0..64).map(|i| if i % 2 == 0 { 1010 } else { 990 }).collect();
        assert_eq!(apportion(&deficit(&uneven, &[2; 64], 256), &room, 128, 1), [2; 64]);
    }

    #[test]
    fn hamilton_s_worked_example() {
        // 10 by 5 : 3 : 2 : 1 of 11: quotas 4.54, 2.72, 1.81, 0.90; floors 4 2 1 0, three left to .90, .81 and .72.
        assert_eq!(apportion(&[5, 3, 2, 1], &ROOM, 10, 1), [4, 3, 2, 1]);
        assert_eq!(apportion(&[0; 4], &ROOM, 6, 1), [2, 2, 1, 1], "ties to the lower index");
        assert_eq!(apportion(&[u32::MAX, 0, 0, 0], &ROOM, 7, 1), [7, 0, 0, 0]);
        assert_eq!(apportion(&[9], &[5], 0, 1), [0]);
    }

    #[test]
    fn what_full_pixels_leave_is_apportioned_again() {
        // 12 by 6 : 3 : 2 : 1 with room for 3: pixel 0 is full at 3, 9 left by 3 : 2 : 1 are 4.5, 3, 1.5: the next two
        // are full, 3 are left for the last.
        assert_eq!(apportion(&[6, 3, 2, 1], &[3, 3, 3, 9], 12, 16), [3, 3, 3, 3]);
        assert_eq!(apportion(&[6, 0, 0, 0], &[2, 2, 2, 2], 6, 16), [2, 2, 1, 1], "the rest alike");
        assert_eq!(apportion(&[1; 4], &[1; 4], 9, 16), [1; 4], "no more than there is room");
        // One round only: pixel 0 is full, the others' floors are 3, 2, 1, and the room of pixel 1 comes first.
        assert_eq!(apportion(&[6, 3, 2, 1], &[3, 9, 9, 9], 12, 1), [3, 6, 2, 1]);
    }

    #[test]
    fn rounds_share_counts_and_lists_name_samples() {
        assert_eq!(offsets(&[3, 0, 4]), [0, 3, 3, 7]);
        assert_eq!(dealt(&[0, 3, 3, 7], 0, 2), [0, 2, 2, 4], "paths 0, 2, 4, 6");
        assert_eq!(dealt(&[0, 3, 3, 7], 1, 2), [0, 1, 1, 3], "paths 1, 3, 5");
        assert_eq!(batch(&[0, 2, 2, 4], &[7, 9, 1], 1, 2), [[0, 7], [2, 1]]);
    }

    #[test]
    fn shares_are_less_what_is_there() {
        assert_eq!(deficit(&[3, 1, 0], &[2, 5, 1], 8), [4 * PARTS, 0, 0]);
        assert_eq!(deficit(&[0, 0], &[1, 0], 5), [3 * PARTS / 2, 5 * PARTS / 2]);
        // (w / t)^2: 4, 6.25 (7), 100; the third has 9 and may double, the fourth has 18 of 20; the fifth has enough,
        // the sixth too, but still lacks one, since its weight shows that its error is above the threshold.
        assert_eq!(need(&[4, 5, 20, 20, 0, 2], &[1, 1, 9, 18, 3, 5], 2, 20), [3, 4, 9, 2, 0, 1]);
        assert_eq!(weigh(&[0.5, f32::NAN, f32::INFINITY, -1.0]), (vec![1 << 19, 0, 0, 0], 2));
    }
}
