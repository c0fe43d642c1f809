//! A number that tells scenes apart, so that samples of one are not added to those of another.
use std::fmt;

/// Odd numbers with bits all over: 2^64 over the golden ratio, and three multipliers of SplitMix64 and its kin.
const ODD: [u64; 4] = [0x9e37_79b9_7f4a_7c15, 0xbf58_476d_1ce4_e5b9, 0x94d0_49bb_1331_11eb, 0xd6e8_feb8_6659_fd93];

/// Of all that was added, in order, the same on every machine and in every run. Against accidents, not against attacks.
///
/// A word w takes a lane h to `fold(h ^ w)`, as FNV-1a does with bytes and a plain product; four lanes, each
/// independent of the others, keep up with memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint([u64; 4]);

impl Default for Fingerprint {
    fn default() -> Self {
        Self(ODD)
    }
}

impl Fingerprint {
    /// Adds an array, with its length: what follows cannot move into it.
    pub fn add<T: bytemuck::NoUninit>(&mut self, items: &[T]) {
        self.add_bytes(bytemuck::cast_slice(items));
    }

    fn add_bytes(&mut self, bytes: &[u8]) {
        let (blocks, rest) = bytes.as_chunks::<32>();
        let mut last = [0; 32];
        last[..rest.len()].copy_from_slice(rest);
        let mut length = [0; 32];
        length[..8].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
        blocks.iter().chain([&last, &length]).for_each(|block| self.mix(block));
    }

    fn mix(&mut self, block: &[u8; 32]) {
        let (words, _) = block.as_chunks::<8>();
        for (lane, (word, odd)) in self.0.iter_mut().zip(words.iter().zip(ODD)) {
            *lane = fold(*lane ^ u64::from_le_bytes(*word), odd);
        }
    }

    /// All lanes in one.
    fn value(&self) -> u64 {
        self.0.iter().fold(0, |h: u64, &lane| fold(h.rotate_left(23) ^ lane, ODD[1]))
    }
}

/// The halves of the product, joined (wyhash, Wang Yi 2019). Of a plain product the top bit depends on all bits, but only the
/// top bit on the top one: then two changes, words apart, can cancel.
fn fold(a: u64, b: u64) -> u64 {
    let product = u128::from(a) * u128::from(b);
    product as u64 ^ (product >> 64) as u64
}

/// 16 hexadecimal digits.
impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{:016x}", self.value())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn of(parts: &[&[u8]]) -> String {
        let mut f = Fingerprint::default();
        parts.iter().for_each(|part| f.add(part));
        f.to_string()
    }

    #[test]
    fn every_bit_counts_and_so_does_every_border() {
        for length in [1, 7, 8, 31, 32, 33, 100] {
            let flipped = (0..length * 8).map(|bit| {
                let mut bytes = vec![0x5a; length];
                bytes[bit / 8] ^= 1 << (bit % 8);
                of(&[&bytes])
            });
            let all: HashSet<_> = flipped.chain([of(&[&vec![0x5a; length]])]).collect();
            assert_eq!(all.len(), length * 8 + 1, "of {length} bytes");
        }
        let cuts: [&[&[u8]]; 6] = [&[], &[b""], &[b"ab"], &[b"a", b"b"], &[b"ab", b""], &[b"ab\0"]];
        assert_eq!(cuts.map(of).into_iter().collect::<HashSet<_>>().len(), 6);
        assert_ne!(of(&[&[1; 32], &[2; 32]]), of(&[&[2; 32], &[1; 32]]));
    }

    #[test]
    fn files_of_earlier_runs_stay_known() {
        let bytes: Vec<u8> = (0..100).collect();
        assert_eq!(of(&[&bytes]), "db7dc42ac42bd3c7");
    }
}
