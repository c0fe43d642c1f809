//! What the frames of a sequence have in common, found before the first: a frame is the same whichever others are rendered.
use crate::layout::Effects;
use crate::render::Outputs;
use crate::render::called_for;
use crate::render::settings::Settings;
use crate::scene::animation::Animation;
use crate::scene::{Bounds, Pose, Scene};
use std::ops::Range;

/// Frames that are looked at for effects: of more, some that are spread evenly.
const FOR_EFFECTS: u32 = 256;
/// Frames whose cameras are compared.
const FOR_CAMERAS: u32 = 256;
/// Frames whose bounds are taken: each moves all surfaces.
const FOR_BOUNDS: u32 = 64;

/// The frames of a sequence.
pub struct Survey<'a> {
    /// As it was loaded.
    pub scene: &'a Scene,
    /// What moves it.
    pub animation: &'a Animation,
    /// Their numbers.
    pub frames: &'a Range<u32>,
    /// Frames per second.
    pub fps: f64,
}

impl Survey<'_> {
    /// The effects that any frame calls for. A frame that lacked one would get a new renderer, which has no samples to carry.
    pub fn effects(&self, settings: &Settings, outputs: Outputs) -> Effects {
        let mut effects = called_for(self.scene, settings, outputs);
        let mut scene = None;
        // The vertices of skins and files take longer to find than all else of a pose, and call for nothing.
        let looks = |pose: &Pose| pose.camera.is_some() || pose.shines();
        for pose in self.poses(FOR_EFFECTS, looks) {
            if let Some(camera) = &pose.camera {
                effects.lens |= camera.lens_radius > 0.0;
                effects.orthographic |= camera.orthographic.is_some();
            }
            let pose = Pose { camera: None, instances: Vec::new(), meshes: Vec::new(), ..pose };
            if !pose.shines() {
                continue;
            }
            let scene = scene.get_or_insert_with(|| self.scene.clone());
            if scene.apply(&pose).is_ok() {
                effects = effects.or(called_for(scene, settings, outputs));
            }
        }
        effects
    }

    /// Whether frames are seen from different places, or otherwise by another camera.
    pub fn moves_camera(&self) -> bool {
        let mut cameras = self.poses(FOR_CAMERAS, |pose| pose.camera.is_some()).map(|pose| pose.camera);
        let first = cameras.next();
        cameras.any(|camera| Some(camera) != first)
    }

    /// Why all frames are alike, where keys show that they are. Of a frame alone there is nothing to say: it has no other to differ from.
    pub fn why_still(&self) -> Option<String> {
        let times @ [first, last] = [self.frames.start, self.frames.end - 1].map(|number| self.seconds(number));
        // Milliseconds are enough to find a key by.
        let short = |seconds: f64| (seconds * 1e3).round() / 1e3;
        match self.animation.moving() {
            _ if self.frames.len() <= 1 => None,
            _ if self.animation.is_empty() => {
                Some("nothing moves in the scene (add [[animation]] tables, or --turntable)".to_owned())
            }
            _ if self.animation.end() == 0.0 => {
                Some("what moves has no key after time 0 (give later keys, another --clip, or --turntable)".to_owned())
            }
            None => Some(format!(
                "what moves has no second key to move to, and its last is at {} s (give more keys, another --clip, or --turntable)",
                short(self.animation.end())
            )),
            Some(_) if self.animation.moves_between(times) => None,
            // What one mover does ends before them, and what another does begins after them.
            Some(span) if span.start < last && first < span.end => Some(format!(
                "they are from {} s to {} s, and no key moves anything between them (choose others by --frames or --fps)",
                short(first),
                short(last)
            )),
            Some(span) => Some(format!(
                "they are from {} s to {} s, and keys from {} s to {} s (choose others by --frames or --fps)",
                short(first),
                short(last),
                short(span.start),
                short(span.end)
            )),
        }
    }

    /// What surfaces reach in all frames, where some move and the camera has no place of its own.
    pub fn bounds(&self) -> Option<Bounds> {
        let keyed = self.animation.at(self.seconds(self.frames.start)).ok().and_then(|pose| pose.camera);
        let camera = keyed.as_ref().unwrap_or(&self.scene.view);
        if camera.position.is_some() || camera.world_from_camera.is_some() {
            return None;
        }
        let (mut scene, mut found) = (None, None);
        for pose in self.poses(FOR_BOUNDS, Pose::moves) {
            let scene = scene.get_or_insert_with(|| self.scene.clone());
            let pose = Pose { camera: None, rebuild_above: f32::INFINITY, ..pose };
            if scene.apply(&pose).is_ok() && scene.bounds != Bounds::default() {
                found = Some(found.map_or(scene.bounds, |all| union(all, scene.bounds)));
            }
        }
        found
    }

    /// Some of the poses, of those movers whose first one is `wanted`, or cannot be told. What cannot be posed is left out: its frame
    /// says so.
    fn poses(&self, most: u32, wanted: impl Fn(&Pose) -> bool) -> impl Iterator<Item = Pose> {
        let mut movers = self.animation.movers.clone();
        movers.retain(|mover| {
            let mut pose = Pose::default();
            mover.pose(self.seconds(self.frames.start), &mut pose).is_err() || wanted(&pose)
        });
        let most = if movers.is_empty() { 0 } else { most };
        let animation = Animation { movers };
        spread(self.frames, most).filter_map(move |number| animation.at(self.seconds(number)).ok())
    }

    fn seconds(&self, number: u32) -> f64 {
        f64::from(number) / self.fps
    }
}

fn union(a: Bounds, b: Bounds) -> Bounds {
    let join = |end: usize, of: fn(f32, f32) -> f32| [0, 1, 2].map(|axis| of(a[end][axis], b[end][axis]));
    [join(0, f32::min), join(1, f32::max)]
}

/// So many of the frames, evenly, with the first and the last; or all.
fn spread(frames: &Range<u32>, most: u32) -> impl Iterator<Item = u32> {
    let (first, steps) = (frames.start, frames.end - frames.start - 1);
    let count = most.min(steps.saturating_add(1));
    let at = move |i: u32| (u64::from(i) * u64::from(steps) / u64::from(count.max(2) - 1)) as u32;
    (0..count).map(move |i| first + at(i))
}

#[cfg(test)]
mod tests {
    use super::spread;

    #[test]
    fn frames_are_spread_from_the_first_to_the_last() {
        let of = |frames, most| spread(&frames, most).collect::<Vec<_>>();
        assert_eq!((of(7..8, 4), of(3..7, 4)), (vec![7], vec![3, 4, 5, 6]));
        assert!(of(3..7, 0).is_empty());
        assert_eq!(of(10..20, 4), [10, 13, 16, 19]);
        assert_eq!(of(0..u32::MAX, 3), [0, (u32::MAX - 1) / 2, u32::MAX - 1]);
    }
}
