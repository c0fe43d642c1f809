//! Points of a scene that moves: the frame that is judged, and those before it, whose samples it may begin with.
use crate::error::Result;
use crate::layout::Effects;
use crate::render::settings::Settings;
use crate::render::{Moves, Outputs, called_for};
use crate::scene::animation::Animation;
use crate::scene::{Change, Scene};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// The frame that is judged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JudgedFrame {
    /// Its number, at least 1.
    pub frame: u32,
    /// Frames per second.
    pub fps: f64,
}

impl JudgedFrame {
    /// Frames before it that are rendered at most. So many fill a history: what more of them add to it is little.
    pub const BEFORE: u32 = 8;
    /// Seeds that a run takes: one for each of its frames.
    pub const SEEDS: u32 = Self::BEFORE + 1;

    /// The first frame of those that a point renders: one before the frame that is judged where nothing is carried, so that the scene
    /// moves into it.
    pub fn first(&self, carries: bool) -> u32 {
        self.frame.saturating_sub(if carries { Self::BEFORE } else { 1 })
    }
}

/// How a scene moves.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The frame that is judged.
    pub judged: JudgedFrame,
    /// What moves.
    pub animation: Animation,
}

impl Motion {
    /// Moves a scene to where it is in a frame.
    ///
    /// # Errors
    /// Those of [`Animation::at`] and [`Scene::apply`].
    pub fn pose(&self, scene: &mut Scene, frame: u32) -> Result<Change> {
        scene.apply(&self.animation.at(f64::from(frame) / self.judged.fps)?)
    }
}

/// A scene that is moved from frame to frame. Between runs it shows the frame that is judged.
pub struct Moving<'a> {
    /// The scene in its pose.
    pub scene: Scene,
    motion: &'a Motion,
    /// What may change between frames.
    pub moves: Moves,
}

impl<'a> Moving<'a> {
    /// Of a scene that shows the frame that is judged.
    pub fn new(scene: &Scene, motion: &'a Motion) -> Self {
        Self { scene: scene.clone(), motion, moves: Moves::of(&motion.animation) }
    }

    /// The frames that a run renders; the last is judged.
    pub fn frames(&self, carries: bool) -> RangeInclusive<u32> {
        self.motion.judged.first(carries)..=self.motion.judged.frame
    }

    /// Moves the scene to a frame.
    ///
    /// # Errors
    /// Those of [`Motion::pose`].
    pub fn pose(&mut self, frame: u32) -> Result<Change> {
        self.motion.pose(&mut self.scene, frame)
    }

    /// Moves it to where it is between runs.
    ///
    /// # Errors
    /// Those of [`Motion::pose`].
    pub fn rest(&mut self) -> Result<Change> {
        self.pose(self.motion.judged.frame)
    }

    /// Effects that any frame of a run calls for, and what all these poses have changed.
    ///
    /// # Errors
    /// Those of [`Motion::pose`].
    pub fn effects(&mut self, settings: &Settings, outputs: Outputs) -> Result<(Effects, Change)> {
        let (mut effects, mut all) = (called_for(&self.scene, settings, outputs), Change::default());
        for frame in self.frames(true) {
            all.add(self.pose(frame)?)?;
            effects = effects.or(called_for(&self.scene, settings, outputs));
        }
        Ok((effects, all))
    }
}
