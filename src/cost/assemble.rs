//! From a plan to its points, and from their runs to a document.
use super::Images;
use super::document::{Document, Machine, Measurement, Method, Point, SCHEMA, SceneInfo};
use super::findings::findings;
use super::interval::CONFIDENCE;
use super::machine;
use super::reference::Reference;
use super::summary::{front, summarise};
use crate::error::Error;
use crate::image::Picture;
use std::time::Duration;

/// Why a measurement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// Every run was made or has failed.
    Complete,
    /// The budget was used up.
    Budget,
    /// The user stopped it.
    Stopped,
}

/// The frame of a document.
pub struct Outline<'a> {
    /// What was rendered or filtered.
    pub scene: &'a SceneInfo,
    /// Where it runs.
    pub machine: Machine,
    /// Seeds of the runs.
    pub seeds: Vec<u32>,
    /// Seed of the random order.
    pub order_seed: u64,
    /// Time for everything.
    pub budget: Option<Duration>,
    /// See [`Measurement::key`].
    pub key: String,
}

/// A point to measure, with the runs that an earlier measurement made. What failed is tried again.
pub fn taken_up(earlier: &[Point], method: Method, command: String) -> Point {
    match earlier.iter().find(|known| known.method == method) {
        Some(known) => Point { failed: None, summary: None, command, ..known.clone() },
        None => Point::unmeasured(method, command),
    }
}

/// Why a point failed, in one line.
pub fn failure(e: &Error) -> String {
    e.to_string().replace('\n', " ")
}

/// Whether runs are still to be made.
pub fn lacks_runs(point: &Point, repeats: u32) -> bool {
    !point.is_other && point.failed.is_none() && point.runs.len() < repeats as usize
}

/// The document of what was measured so far. Complete is what has all its runs, its pictures, and its page.
pub fn document(outline: &Outline, mut points: Vec<Point>, reference: &Reference, complete: bool) -> Document {
    summarise(&mut points);
    Document {
        schema: SCHEMA,
        complete,
        software: machine::software(),
        scene: outline.scene.clone(),
        machine: outline.machine.clone(),
        reference: reference.info.clone(),
        measurement: Measurement {
            repeats: outline.seeds.len() as u32,
            seeds: outline.seeds.clone(),
            order_seed: outline.order_seed,
            budget_minutes: outline.budget.map(|budget| budget.as_secs_f64() / 60.0),
            confidence: CONFIDENCE,
            key: outline.key.clone(),
        },
        front: front(&points),
        findings: findings(&points),
        points,
    }
}

/// The pictures of the points that have one, and the reference.
pub fn images(pictures: Vec<Option<Picture>>, reference: &Reference) -> Images {
    let points = pictures.into_iter().enumerate().filter_map(|(i, picture)| Some((i, picture?))).collect();
    Images { reference: reference.picture.clone(), points }
}
