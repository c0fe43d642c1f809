//! The history of a frame in its film, by which a later run goes on as if it had never stopped.
use super::rendered::check_values;
use super::{Renderer, Step, film};
use crate::error::{Error, Result};
use crate::gpu::FrameResources;
use crate::image::{Film, Samples};
use crate::layout::{NONE, SurfacePoint};
use crate::render::carriage::Carried;
use crate::scene::Scene;
use crate::shaders::shared::history::MOST_CARRIED;

/// Samples of a pixel that are of earlier frames.
const SAMPLES: &str = "carried.samples";
/// Frames that they were carried through.
const AGE: &str = "carried.age";
/// The point that a pixel's samples are of: numbers that no pose changes, and weights of the triangle's vertices 1 and 2.
const POINT: [&str; 4] = ["point.triangle", "point.instance", "point.u", "point.v"];

impl Renderer {
    /// Adds to the film of a frame what its pixels had from earlier frames, and the points that their samples are of. `scene` is as
    /// it was rendered.
    ///
    /// # Errors
    /// [`Error::Usage`] without a history, [`Error::Device`].
    pub fn add_history(&self, film: &mut Film, scene: &Scene) -> Result<()> {
        let history = self.frame.history()?;
        let carried: Vec<_> = history.carried.read()?.into_iter().map(Carried::of_pixel).collect();
        film.add(SAMPLES, Samples::U32(carried.iter().map(|c| c.count).collect()));
        film.add(AGE, Samples::U32(carried.iter().map(|c| c.age).collect()));
        let points = self.frame.film.tiles[0].points.read()?;
        let of = |numbers: Vec<u32>, index: fn(&SurfacePoint) -> u32| {
            let number = |p| numbers.get(index(p) as usize).copied().unwrap_or(NONE);
            Samples::U32(points.iter().map(number).collect())
        };
        film.add(POINT[0], of(scene.triangle_numbers(), |p| p.triangle));
        film.add(POINT[1], of(scene.instance_numbers(), |p| p.instance));
        film.add(POINT[2], Samples::F32(points.iter().map(|p| p.weights[0]).collect()));
        film.add(POINT[3], Samples::F32(points.iter().map(|p| p.weights[1]).collect()));
        Ok(())
    }

    /// Puts back the end of a frame, out of its film with what [`Self::add_history`] added: a [`Step::Reproject`] that follows carries the
    /// samples on, to the same bits where the renderer has the frame's seed and first sample. `scene` is in the frame's pose, and the
    /// renderer was told of it.
    ///
    /// # Errors
    /// [`Error::Usage`] without a history, and for a film of another size, without a layer or with values that no samples have;
    /// [`Error::Device`].
    pub fn take_up(&self, frame: &mut FrameResources, film: &Film, scene: &Scene) -> Result<()> {
        let history = self.frame.history()?;
        let (wanted, found) = (self.settings.size(), film.size());
        if wanted != found {
            return Err(Error::Usage(format!("a film of {found:?} pixels cannot go on as one of {wanted:?}")));
        }
        let lacks = |what: String| Error::Usage(format!("the frame before {what}"));
        self.check_split(film::splits_light(film).map_err(lacks)?)?;
        let pixels = film::pixels(film).map_err(lacks)?;
        let broken = |what| Error::Usage(format!("the frame before: {what}"));
        check_values(&pixels, film.width).map_err(broken)?;
        let [samples, age] = [SAMPLES, AGE].map(|name| film::counts(film, name).map_err(lacks));
        let (samples, age) = (samples?, age?);
        // Numbers of a damaged file stay within their bits.
        let word =
            |i: usize| Carried { count: samples[i].min(MOST_CARRIED), age: age[i].min(255), edge: false, back: false };
        let points = points(film, scene)?;
        self.run(frame, &Step::Start)?;
        self.write_pixels(&pixels)?;
        self.frame.film.tiles[0].points.write(0, &points)?;
        history.carried.write(0, &(0..pixels.len()).map(|i| word(i).word()).collect::<Vec<_>>())
    }
}

/// The points of a film as the scene numbers them now.
fn points(film: &Film, scene: &Scene) -> Result<Vec<SurfacePoint>> {
    let lacks = |what: String| Error::Usage(format!("the frame before {what}"));
    let index = |name: &str, numbers: Vec<u32>| {
        let mut index_of = vec![NONE; numbers.len()];
        (0..).zip(numbers).for_each(|(index, number)| index_of[number as usize] = index);
        let found = film::counts(film, name).map_err(lacks)?;
        Ok(found.iter().map(|&number| index_of.get(number as usize).copied().unwrap_or(NONE)).collect::<Vec<_>>())
    };
    let (triangle, instance) = (index(POINT[0], scene.triangle_numbers())?, index(POINT[1], scene.instance_numbers())?);
    let [u, v] = [POINT[2], POINT[3]].map(|name| film::floats(film, name).map_err(lacks));
    let (u, v) = (u?, v?);
    let point = |i: usize| SurfacePoint {
        triangle: triangle[i],
        instance: instance[i],
        weights: [u[i], v[i]],
        ..SurfacePoint::default()
    };
    Ok((0..triangle.len()).map(point).collect())
}
