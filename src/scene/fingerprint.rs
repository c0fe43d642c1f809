//! A number that identifies a scene, so that samples of one are not added to those of another.
use super::Scene;
use crate::layout::{Instance, Light, Material};
use std::fmt;
use xxhash_rust::xxh3::Xxh3Default;

/// Hash of all that was added, in order: xxh3 of 128 bits, the same on every machine and in every run. It detects accidents, not
/// attacks.
#[derive(Clone, Default)]
pub struct Fingerprint(Xxh3Default);

impl Fingerprint {
    /// Adds an array, with its length: what follows cannot move into it.
    pub fn add<T: bytemuck::NoUninit>(&mut self, items: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(items);
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }
}

impl PartialEq for Fingerprint {
    fn eq(&self, other: &Self) -> bool {
        self.0.digest128() == other.0.digest128()
    }
}

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Fingerprint({self})")
    }
}

/// Written as 32 hexadecimal digits.
impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{:032x}", self.0.digest128())
    }
}

/// `content` with all that poses change.
pub(in crate::scene) fn posed(scene: &Scene, mut content: Fingerprint) -> Fingerprint {
    let rig = &scene.rig;
    let mut copies: Vec<_> = scene.instances.clone();
    for (&copy, instance) in rig.order.iter().zip(&scene.instances) {
        let hidden = u32::from(rig.hidden.contains(&copy));
        copies[copy as usize] = match hidden {
            0 => Instance { root: rig.tree_of[copy as usize], ..*instance },
            _ => Instance::default(),
        };
    }
    content.add(&copies);
    content.add(&scene.materials.iter().map(|m| Material { coat_table: 0, ..*m }).collect::<Vec<Material>>());
    content.add::<Light>(&rig.lights);
    rig.trees.iter().filter_map(|t| t.soft.as_ref()).for_each(|soft| content.add(soft.pose.as_bytes()));
    content
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
        // xxh3_128 of the length, eight bytes, and the bytes, by another implementation (the Python package xxhash).
        let bytes: Vec<u8> = (0..100).collect();
        assert_eq!(of(&[&bytes]), "2435b90cb0c67ef8747c7a3e5a625fe9");
    }
}
