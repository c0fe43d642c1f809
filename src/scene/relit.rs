//! Lights before and after a change, for paths that are to find what it brings.
use super::Scene;
use super::build::alias;
use crate::layout::{AliasEntry, LIGHT_ENVIRONMENT, Light, NONE};
use std::cmp::Ordering;

/// The lights of a scene before and after a change, in the same order, and a table that chooses one of them: half of the time one that
/// has changed. By power alone, paths would seldom meet a lamp that outshines others only near itself; and by the table of each scene,
/// the same random number would choose other lights. One that is not there emits nothing.
#[derive(Clone, Debug, Default)]
pub struct Relit {
    /// As [`Scene::lights`], with probabilities of the table below.
    pub before: Vec<Light>,
    /// The same lights now.
    pub after: Vec<Light>,
    /// Chooses among them.
    pub table: Vec<AliasEntry>,
    /// As [`crate::layout::PathConstants::environment`].
    pub environment: u32,
    /// What [`Scene::triangle_pdf_scale`] of the scene before is multiplied by; exact for lamps that have not changed.
    pub pdf_scale: f32,
}

/// Share of the choices that falls to lights that have changed.
const CHANGED: f32 = 0.5;

impl Relit {
    /// Of the lights before, by ascending numbers, and those of the scene; `None` where they are the same, with the same table.
    pub fn of(before: &[(u64, Light)], scene: &Scene) -> Option<Self> {
        let now = || scene.rig.light_numbers.iter().copied().zip(scene.lights.iter().copied());
        let still =
            |(a, b): (&(u64, Light), (u64, Light))| a.0 == b.0 && Light { triangle: b.1.triangle, ..a.1 } == b.1;
        if before.len() == scene.lights.len() && before.iter().zip(now()).all(still) {
            return None;
        }
        let (mut before, mut after) = joined(before.iter().copied(), now()).into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
        let changed: Vec<bool> = before.iter().zip(&after).map(|(a, b)| has_changed(a, b)).collect();
        // Densities of lamps that a path meets are those before, times a factor: so are the choices of those that stay.
        let weight = |((a, b), changed): ((&Light, &Light), &bool)| match changed {
            true => a.probability.max(b.probability),
            false => a.probability,
        };
        let weights: Vec<f32> = before.iter().zip(&after).zip(&changed).map(weight).collect();
        let sum = |of: bool| weights.iter().zip(&changed).filter(|(_, c)| **c == of).map(|(w, _)| w).sum::<f32>();
        let scale = match [sum(false), sum(true)] {
            [kept, new] if kept > 0.0 && new > 0.0 => [(1.0 - CHANGED) / kept, CHANGED / new],
            _ => [1.0; 2],
        };
        let chosen = |(w, c): (&f32, &bool)| f64::from(w * scale[usize::from(*c)]);
        let table = alias::build(&weights.iter().zip(&changed).map(chosen).collect::<Vec<_>>());
        for (i, p) in alias::probabilities(&table).into_iter().enumerate() {
            (before[i].probability, after[i].probability) = (p as f32, p as f32);
        }
        let environment = before.iter().position(|l| l.kind == LIGHT_ENVIRONMENT).map_or(NONE, |i| i as u32);
        Some(Self { before, after, table, environment, pdf_scale: scale[0] })
    }
}

fn has_changed(a: &Light, b: &Light) -> bool {
    Light { probability: b.probability, triangle: b.triangle, ..*a } != *b
}

/// Pairs of the same light before and after.
fn joined(
    before: impl Iterator<Item = (u64, Light)>,
    after: impl Iterator<Item = (u64, Light)>,
) -> Vec<(Light, Light)> {
    let dark = |light: Light| Light { value: [0.0; 3], probability: 0.0, ..light };
    let (mut before, mut after, mut pairs) = (before.peekable(), after.peekable(), Vec::new());
    loop {
        let order = match (before.peek(), after.peek()) {
            (None, None) => return pairs,
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (Some(a), Some(b)) => a.0.cmp(&b.0),
        };
        let old = if order.is_le() { before.next().map(|(_, light)| light) } else { None };
        let new = if order.is_ge() { after.next().map(|(_, light)| light) } else { None };
        match (old, new) {
            (Some(old), Some(new)) => pairs.push((old, new)),
            (Some(old), None) => pairs.push((old, dark(old))),
            (None, Some(new)) => pairs.push((dark(new), new)),
            (None, None) => return pairs,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(value: f32, probability: f32) -> Light {
        Light { value: [value; 3], probability, ..Light::default() }
    }

    fn scene(lights: &[(u64, Light)]) -> Scene {
        let mut scene = Scene { lights: lights.iter().map(|(_, light)| *light).collect(), ..Scene::default() };
        scene.rig.light_numbers = lights.iter().map(|(number, _)| *number).collect();
        scene
    }

    #[test]
    fn lights_that_change_are_chosen_half_of_the_time() {
        // The second of four goes out, a fifth appears, and the fourth is brighter.
        let before = [(0, light(4.0, 0.4)), (1, light(1.0, 0.1)), (7, light(3.0, 0.3)), (9, light(2.0, 0.2))];
        let after = [(0, light(4.0, 0.3)), (7, light(3.0, 0.2)), (9, light(5.0, 0.4)), (11, light(1.0, 0.1))];
        let relit = Relit::of(&before, &scene(&after)).unwrap();
        let values = |lights: &[Light]| lights.iter().map(|l| l.value[0]).collect::<Vec<_>>();
        assert_eq!(values(&relit.before), [4.0, 1.0, 3.0, 2.0, 0.0]);
        assert_eq!(values(&relit.after), [4.0, 0.0, 3.0, 5.0, 1.0]);
        // 0.4 and 0.3 share one half, 0.1, 0.4 and 0.1 the other.
        let expected = [2.0 / 7.0, 1.0 / 12.0, 1.5 / 7.0, 1.0 / 3.0, 1.0 / 12.0];
        for (i, p) in expected.iter().enumerate() {
            let found = [relit.before[i].probability, relit.after[i].probability];
            assert!(found.iter().all(|f| (f - p).abs() < 1e-6), "{i}: {found:?}");
        }
        assert!((relit.pdf_scale - 0.5 / 0.7).abs() < 1e-6 && relit.table.len() == 5);
    }

    /// A path that meets a kept lamp counts on the density of the scene before, times that factor.
    #[test]
    fn kept_lights_are_chosen_as_their_density_says() {
        // The first goes out, so that the others are chosen more often; or it lights up, and they are less often.
        let many = [(0, light(6.0, 0.6)), (1, light(3.0, 0.3)), (2, light(1.0, 0.1))];
        let few = [(1, light(3.0, 0.75)), (2, light(1.0, 0.25))];
        for (before, after) in [(&many[..], &few[..]), (&few[..], &many[..])] {
            let relit = Relit::of(before, &scene(after)).unwrap();
            assert!((relit.after[0].probability - 0.5).abs() < 1e-6);
            for (number, was) in before.iter().filter(|(number, _)| *number > 0) {
                let (now, said) = (relit.after[*number as usize].probability, was.probability * relit.pdf_scale);
                assert!((now - said).abs() < 1e-6, "light {number}: {now}, not {said}");
            }
        }
    }

    #[test]
    fn lights_that_stay_need_no_other_table() {
        let lights = [(0, light(4.0, 0.4)), (3, light(1.0, 0.6))];
        assert!(Relit::of(&lights, &scene(&lights)).is_none());
        let moved = [(0, Light { triangle: 5, ..light(4.0, 0.4) }), lights[1]];
        assert!(Relit::of(&lights, &scene(&moved)).is_none(), "another number of its triangle");
        let dimmer = [(0, light(3.0, 0.3)), (3, light(1.0, 0.7))];
        assert!(Relit::of(&lights, &scene(&dimmer)).is_some());
        assert!(Relit::of(&[], &scene(&[])).is_none());
        // The table of a scene whose other lights went out is another, and so is the choice.
        let relit = Relit::of(&lights, &scene(&[lights[1]])).unwrap();
        assert_eq!(relit.after[0].value, [0.0; 3]);
    }
}
