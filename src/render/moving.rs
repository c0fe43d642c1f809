//! Frames that begin with the samples of the last: what a renderer needs for it, and what became of them.
use super::carriage::{Carriage, carried_samples};
use super::history::{History, Moves, Reproject, Reprojection};
use super::schedule::{self, Begun, Plan, Share};
use super::{Renderer, Step, kernels};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, FrameResources, Gpu, PassTime};
use crate::layout::{NONE, PixelStats, SurfacePoint};
use crate::render::settings::Settings;
use crate::scene::Scene;

impl Renderer {
    /// From now on frames can begin with [`Step::Reproject`] in place of [`Step::Start`]: with the samples of the last frame that
    /// show the same surface from the new camera. Call it once, before anything is recorded; the renderer must have been made with
    /// [`super::Outputs::guides`]. The first [`Step::Reproject`] of all carries nothing, nor does one of a camera with a lens or parallel
    /// rays, or after such a one, unless nothing has changed. `moves` says what may change between frames.
    ///
    /// Carried samples count in the mean, in its variance and in the number of samples of a pixel. They are no part of the
    /// sequence that new samples come from: give each frame its own by [`Self::set_first_sample`], or its own seed. How many are worth
    /// carrying is judged by [`Settings::spp`], which should be what frames take: 64 in place of the 1 that they took left 1.4 times the
    /// error on a camera's way through the Cornell box.
    ///
    /// # Errors
    /// [`Error::Usage`] for a setting out of range or `indirect_stride`, for a renderer without guides and for a film that is too large;
    /// [`Error::Device`].
    pub fn keep_history(&mut self, settings: Reproject, moves: Moves) -> Result<()> {
        if !self.frame.film.tiles[0].has_guide() {
            let what = "a history needs primary hits: make the renderer with Outputs::guides";
            return Err(Error::Usage(what.into()));
        }
        if settings.reproject == Reprojection::Off {
            return Ok(());
        }
        check_stride(&self.settings)?;
        let history = History::new(&self.gpu, self.effects, self.stack, &self.settings, settings, moves)?;
        let tile = &mut self.frame.film.tiles[0];
        let none = SurfacePoint { triangle: NONE, instance: NONE, ..SurfacePoint::default() };
        tile.keep_points(Buffer::from_slice(&self.gpu, "points", &vec![none; self.settings.pixels()])?);
        tile.stats.write(0, &vec![PixelStats::default(); self.settings.pixels()])?;
        self.frame.kernels.primary_hit = kernels::primary_hit(&self.gpu, self.effects, self.stack, true)?;
        self.frame.history = Some(history);
        Ok(())
    }

    /// What is carried from frame to frame; none without [`Self::keep_history`].
    pub fn history(&self) -> Option<&History> {
        self.frame.history.as_ref()
    }

    /// The work of a frame that begins with the samples of the last: [`Self::steps`], but for its beginning. Every pixel gets its
    /// least number of samples anew, and the policy's share of the others, however many it carries; [`Self::begin_frame`] counts carried
    /// ones. So does a largest number of samples, which carried ones may have reached.
    pub fn steps_on(&self) -> impl Iterator<Item = Step> + use<> {
        let anew = |step| match step {
            Step::Allocate(plan) if matches!(plan.share, Share::All(_)) => {
                Step::Allocate(Plan { share: Share::Next, ..plan })
            }
            step => step,
        };
        std::iter::once(Step::Reproject).chain(self.steps().skip(1).map(anew))
    }

    /// Runs [`Step::Reproject`] and returns the GPU time of its passes and the rest of the frame's work, in which carried samples
    /// count: of the frame's budget, `spp` samples for each pixel on average, pixels with fewer than `min_spp` get what they lack
    /// of those first. The rest is placed by the policy, which compares what pixels have with their shares of all samples, carried
    /// ones included. The samples of the frame sum to the budget exactly. Pixels get different numbers of them, so that frames
    /// need seeds of their own: [`Self::set_seed`].
    ///
    /// It waits for the device, which alone knows what is carried.
    ///
    /// # Errors
    /// [`Error::Usage`] without a history, and for settings under which no budget is placed: a noise threshold, a largest number of
    /// samples or a policy that chooses; [`Error::Device`].
    pub fn begin_frame(&self, frame: &mut FrameResources) -> Result<(Vec<PassTime>, Vec<Step>)> {
        let (settings, film) = (&self.settings, &self.frame.film);
        let history = self.frame.history()?;
        let allocate = &settings.allocate;
        if allocate.is_even() {
            return Ok((self.run(frame, &Step::Reproject)?, self.steps().skip(1).collect()));
        }
        check_placing(settings)?;
        let times = self.run(frame, &Step::Reproject)?;
        let have: Vec<u32> = history.carried.read()?.into_iter().map(carried_samples).collect();
        let lacks: Vec<u32> = have.iter().map(|n| schedule::first_spp(settings).saturating_sub(*n)).collect();
        let sum = |counts: &[u32]| counts.iter().map(|&n| u64::from(n)).sum();
        film.counts.count.write(0, &lacks)?;
        let allocation = self.frame.allocation()?;
        self.gpu.run(frame, |rec| allocation.scan.record(rec, &film.counts))?;
        let begun = Begun { placed: sum(&lacks), carried: sum(&have) };
        Ok((times, schedule::frame(settings, &self.cut(), begun).collect()))
    }

    /// Chooses the index of each pixel's first sample in its sequence, from the next [`Step::Start`] or [`Step::Reproject`] on. One of
    /// them has to follow before more samples are taken. Behind index 2^32 - 1 comes 0; a film that begins within 2^24 of there can be
    /// neither resumed nor merged. As a setting it is at most 2^24, so that a
    /// renderer that is made of [`Renderer::settings`] may need this call again.
    pub fn set_first_sample(&mut self, first_sample: u32) {
        *self.relabelled.get_mut() |= self.settings.first_sample != first_sample;
        self.frame.first_sample = first_sample;
        self.settings.first_sample = first_sample;
    }

    /// What became of the pixels at the last [`Step::Reproject`].
    ///
    /// # Errors
    /// [`Error::Usage`] without a history, [`Error::Device`].
    pub fn carriage(&self) -> Result<Carriage> {
        let history = self.frame.history()?;
        Ok(Carriage::of(&history.offered.read()?, &history.carried.read()?))
    }

    /// Samples of a pixel that are not of this frame.
    pub(super) fn carried_at(&self, pixel: u32) -> Result<u32> {
        let Some(history) = &self.frame.history else { return Ok(0) };
        let at = pixel as usize;
        Ok(carried_samples(history.carried.read_range(at..at + 1)?[0]))
    }
}

/// Whether frames of a scene can begin with samples of the last.
///
/// # Errors
/// [`Error::Usage`] with what speaks against it: a lens, parallel rays, too many pixels, or settings under which no budget is placed.
pub fn can_carry(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<()> {
    History::check_camera(&scene.camera(settings.size())?)?;
    History::check_room(gpu, settings.pixels() as u32)?;
    check_placing(settings)
}

fn check_stride(settings: &Settings) -> Result<()> {
    match settings.indirect_stride {
        0 | 1 => Ok(()),
        _ => Err(Error::Usage(
            "carried samples hold all light of their pixels: set indirect_stride to 1 to reproject".into(),
        )),
    }
}

fn check_placing(settings: &Settings) -> Result<()> {
    check_stride(settings)?;
    match settings.allocate.list_may_be_short() || settings.allocate.max_spp > 0 {
        true => Err(Error::Usage(
            "carried samples count where a budget is placed: set neither noise_threshold nor max_spp, and choose one of the policies \
             uniform, geometry, variance and both"
                .into(),
        )),
        false => Ok(()),
    }
}
