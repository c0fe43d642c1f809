//! What a sequence keeps from frame to frame: the scene, its motion, and the renderer.
use super::chain::Chain;
use super::survey::Survey;
use super::{Args, FrameReport, MOST_FRAMES, Told};
use crate::cli::Exit;
use crate::cli::common::Warnings;
use crate::cli::files::{Files, first_with_layers};
use crate::cli::render::{self, EffectChoice, Spans, outputs};
use crate::denoise::filter::Method;
use crate::error::{Error, Result};
use crate::gpu::{FrameResources, Gpu};
use crate::image::{self, FILTERED, Film};
use crate::layout::Effects;
use crate::render::settings::Settings;
use crate::render::{
    Job, Moves, Outputs, Renderer, Reproject, Reprojection, all_effects, called_for, can_carry, finished,
};
use crate::scene::animation::{Animation, Turntable};
use crate::scene::{Change, Loaded, Scene};
use crate::settings::entry;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// All that is kept.
pub struct Stage<'a> {
    args: &'a Args,
    gpu: Gpu,
    scene: Scene,
    animation: Animation,
    /// Numbers of all frames.
    frames: Range<u32>,
    settings: Settings,
    /// What a camera without position has in view in every frame.
    framed: Option<[[f32; 3]; 2]>,
    /// Effects of all frames that were looked at: see [`Survey::effects`].
    rest: Effects,
    renderer: Option<Renderer>,
    /// What the renderer has not been told of.
    change: Change,
    /// How samples are carried, if they are.
    reproject: Option<Reproject>,
    /// Whether each frame has random numbers of its own.
    own_seeds: bool,
    /// What moves.
    moves: Moves,
    /// The frames before the one that is next.
    chain: Chain,
    /// The frame that the renderer's history is of.
    held: Option<u32>,
}

impl<'a> Stage<'a> {
    /// Loads the scene and opens the device, and warns of what is odd in the scene, the frames and the options.
    ///
    /// # Errors
    /// Of every kind.
    pub fn new(args: &'a Args, warnings: &mut Warnings) -> Result<Self> {
        let (Loaded { mut scene, mut animation, .. }, settings) = render::load(&args.render)?;
        let frames = args.frames.clone().map_or_else(|| whole(&animation, args.fps), Ok)?;
        args.check_with(&frames, &scene)?;
        let survey = Survey { scene: &scene, animation: &animation, frames: &frames, fps: args.fps };
        scene.view.framed = survey.bounds().or(scene.view.framed);
        let framed = scene.view.framed;
        if let Some(degrees) = args.turntable {
            let span = f64::from(frames.start) / args.fps..f64::from(frames.end) / args.fps;
            animation.movers.push(Arc::new(Turntable::new(&scene, settings.size(), degrees, span)));
        }
        warnings.add(scene.warnings.clone());
        let survey = Survey { scene: &scene, animation: &animation, frames: &frames, fps: args.fps };
        warnings.add(survey.why_still().map(|why| format!("all frames are alike: {why}")));
        let gpu = args.render.common.open(args.render.tracing)?;
        render::check_room(args.render.filter(&settings), &settings, &gpu)?;
        render::check_stride(&args.render, &settings, warnings)?;
        render::warn_of_lens(&args.render, &scene, warnings);
        let survey = Survey { scene: &scene, animation: &animation, frames: &frames, fps: args.fps };
        let rest = survey.effects(&settings, args.render.wanted());
        let reproject = carrying(args, &gpu, &scene, &settings, !animation.is_empty())?;
        let own_seeds = args.seed_per_frame || reproject.is_some() || slides(args, &survey);
        render::warn_of_unread(&args.render, &settings, warnings);
        if reproject.is_none() {
            render::warn_of_unplaced(&settings, warnings);
        }
        Ok(Self {
            args,
            gpu,
            scene,
            moves: Moves::of(&animation),
            animation,
            frames,
            settings,
            framed,
            rest,
            renderer: None,
            change: Change::default(),
            reproject,
            own_seeds,
            chain: Chain::default(),
            held: None,
        })
    }

    /// Numbers of all frames.
    pub fn frames(&self) -> &Range<u32> {
        &self.frames
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Renders a frame, if it is not finished. Nothing that fails here keeps later frames from being rendered.
    pub fn frame(&mut self, number: u32, told: &mut Told) -> (FrameReport, Result<Exit>) {
        told.warnings.are_of(format!("frame {number}"));
        let begun = Instant::now();
        let mut report = FrameReport { frame: number, ..Default::default() };
        let result = self.try_frame(number, &mut report, told);
        if let Err(e) = &result {
            report.error = Some(e.to_string());
            (self.chain, self.held) = (Chain::default(), None);
        }
        if let Err(Error::Memory(_)) = result {
            // A pose may be half taken, of which no change tells: the next frame makes another renderer.
            (self.renderer, self.change) = (None, Change::default());
        }
        report.seconds = begun.elapsed().as_secs_f64();
        (report, result)
    }

    fn try_frame(&mut self, number: u32, report: &mut FrameReport, told: &mut Told) -> Result<Exit> {
        let (args, settings) = (self.args.of_frame(number)?, self.settings_of(number));
        let begun = Instant::now();
        self.pose(number, report)?;
        report.pose_seconds = begun.elapsed().as_secs_f64();
        if let Some(film) = self.finished_film(&args, &settings).filter(|_| !self.args.again) {
            report.skipped = true;
            outputs::save_pictures(&args, &film)?;
            // A run that was not interrupted has compiled in what this frame calls for.
            self.rest = self.rest.or(called_for(&self.scene, &settings, self.wanted()));
            self.chain = self.chain.or_of(&film).with(&self.scene, &settings, self.reproject)?;
            return told.show(&film, &args).map(|()| Exit::Done);
        }
        outputs::check(&args)?;
        let begun = Instant::now();
        self.hold(number, report)?;
        self.prepare(&settings)?;
        report.pose_seconds += begun.elapsed().as_secs_f64();
        let carries = number.checked_sub(1).is_some_and(|before| self.held == Some(before));
        if !carries {
            self.chain = Chain::default();
        }
        let mut shot = self.shoot(&args, &settings, carries, &mut told.warnings)?;
        if let Some(shot) = &mut shot {
            shot.film_mut().metadata.insert(render::FRAME.to_owned(), number.to_string());
        }
        // What is there of an interrupted frame is of no use: it begins anew, and a .png of it would look like a finished one.
        let Some(mut shot) = shot.filter(render::Taken::is_whole) else { return Ok(Exit::Interrupted) };
        if carries {
            report.carriage = Some(self.renderer()?.carriage()?);
        }
        told.warnings.add(render::black::why(shot.film(), &self.scene, &settings));
        shot.finish(&args, None, false, &mut told.warnings)?;
        told.show(shot.film(), &args)?;
        self.chain = self.chain.with(&self.scene, &settings, self.reproject)?;
        self.held = self.reproject.map(|_| number);
        Ok(Exit::Done)
    }

    /// The one that [`Self::prepare`] has made.
    fn renderer(&self) -> Result<&Renderer> {
        self.renderer.as_ref().ok_or_else(|| Error::Usage("there is no renderer".into()))
    }

    /// What a frame is rendered with: its seed is the sequence's plus the frame's number, or the same for all.
    fn settings_of(&self, number: u32) -> Settings {
        let mut settings = self.settings.clone();
        if self.own_seeds {
            settings.seed = settings.seed.wrapping_add(number);
        }
        settings
    }

    /// Takes the samples of a frame.
    fn shoot(
        &self,
        args: &render::Args,
        settings: &Settings,
        carries: bool,
        warnings: &mut Warnings,
    ) -> Result<Option<render::Taken<'_>>> {
        let renderer = self.renderer()?;
        let job = Job { carries, ..Job::new(renderer) };
        let shot = render::Shot { args, gpu: &self.gpu, job };
        let mut shot = render::shoot(shot, Files::of_frame(), Spans::default(), warnings)?;
        if let Some(shot) = shot.as_mut().filter(|_| self.reproject.is_some()) {
            renderer.add_history(shot.film_mut(), &self.scene)?;
            self.chain.tell(shot.film_mut(), &self.scene, settings, self.reproject)?;
        }
        Ok(shot)
    }

    /// Sees to it that the renderer has the history of the frame before this one, where there is a file that holds it.
    fn hold(&mut self, number: u32, report: &mut FrameReport) -> Result<()> {
        let Some(before) = number.checked_sub(1).filter(|&n| self.reproject.is_some() && self.held != Some(n)) else {
            return Ok(());
        };
        self.held = None;
        let Some(film) = self.chain.is_begun().then(|| self.film_of(before)).flatten() else { return Ok(()) };
        self.pose(before, report)?;
        self.prepare(&self.settings_of(before))?;
        self.renderer()?.take_up(&mut FrameResources::new(&self.gpu)?, &film, &self.scene)?;
        self.held = Some(before);
        self.pose(number, report)
    }

    fn film_of(&self, number: u32) -> Option<Film> {
        let files = self.args.of_frame(number).ok()?.output_files();
        image::read(first_with_layers(&files)?).ok()
    }

    /// Moves the scene to where it is in a frame.
    fn pose(&mut self, number: u32, report: &mut FrameReport) -> Result<()> {
        let mut pose = self.animation.at(f64::from(number) / self.args.fps)?;
        if let Some(camera) = &mut pose.camera {
            camera.framed = camera.framed.or(self.framed);
        }
        let change = self.scene.apply(&pose)?;
        report.refit_cost = change.deformed.iter().map(|d| d.cost).reduce(f32::max);
        report.rebuilt = change.deformed.iter().filter(|d| d.rebuilt).count();
        self.change.add(change)
    }

    /// Tells the renderer of what has changed, or makes one with the effects that this frame calls for too.
    fn prepare(&mut self, settings: &Settings) -> Result<()> {
        // After an update that failed, nobody knows what the device has of the scene: the next frame makes another
        // renderer.
        if let Some(mut renderer) = self.renderer.take() {
            renderer.set_seed(settings.seed);
            let (scene, change) = (&self.scene, &self.change);
            let mut frame = FrameResources::new(&self.gpu)?;
            match self.gpu.run(&mut frame, |rec| renderer.update(rec, scene, change)) {
                Err(Error::Usage(_)) => {}
                other => {
                    other?;
                    (self.renderer, self.change) = (Some(renderer), Change::default());
                    return Ok(());
                }
            }
        }
        let wanted = self.wanted();
        let effects = match self.args.render.effects {
            EffectChoice::All => self.rest.or(all_effects(&self.scene, settings)),
            EffectChoice::Auto => self.rest.or(called_for(&self.scene, settings, wanted)),
        };
        let mut renderer = Renderer::specialised(&self.gpu, &self.scene, settings, wanted, effects)?;
        if let Some(how) = self.reproject {
            renderer.keep_history(how, self.moves)?;
        }
        (self.renderer, self.held) = (Some(renderer), None);
        (self.rest, self.change) = (effects, Change::default());
        Ok(())
    }

    /// A history needs primary hits.
    fn wanted(&self) -> Outputs {
        let wanted = self.args.render.wanted();
        Outputs { guides: wanted.guides || self.reproject.is_some(), ..wanted }
    }

    /// The film of a frame that an earlier run has finished, by what its first file with all layers holds.
    fn finished_film(&self, args: &render::Args, settings: &Settings) -> Option<Film> {
        let files = args.output_files();
        let first = first_with_layers(&files)?;
        let film = match self.reproject {
            Some(_) => image::read(first)
                .ok()
                .filter(|film| self.chain.ends_in(film, &self.scene, settings, self.reproject))?,
            None => finished(first, &self.scene, settings)?,
        };
        (film.metadata.get(FILTERED).map(String::as_str) == args.filter(settings).map(Method::name)).then_some(film)
    }
}

/// The frames up to the last key.
fn whole(animation: &Animation, fps: f64) -> Result<Range<u32>> {
    let last = animation.last_frame(fps);
    if animation.end() == 0.0 {
        let how = match animation.is_empty() {
            true => "nothing moves; give --frames 0..96",
            false => "what moves has no key after time 0; give --frames 0..1 for its pose, or another --clip",
        };
        return Err(Error::Usage(format!("how many frames there are is not known: {how}")));
    }
    if last >= MOST_FRAMES as f64 {
        return Err(Error::Usage(format!("{last} frames last to the end of what moves: choose some by --frames")));
    }
    Ok(0..last as u32 + 1)
}

/// Whether noise of one seed would be a pattern on the screen, through which the scene slides, since the camera moves. With
/// `--reproject off`, frames have the seed that they are asked for with, to compare each with a render of its own.
fn slides(args: &Args, survey: &Survey) -> bool {
    args.carry.reproject != Some(Reprojection::Off) && survey.moves_camera()
}

/// How samples are carried: as asked for, or where something moves and nothing speaks against it.
fn carrying(args: &Args, gpu: &Gpu, scene: &Scene, settings: &Settings, moves: bool) -> Result<Option<Reproject>> {
    let able = can_carry(gpu, scene, settings);
    let carries = match args.carry.reproject {
        Some(Reprojection::Off) => false,
        Some(_) => able.map(|()| true)?,
        None => moves && able.is_ok(),
    };
    let mut how = Reproject::default();
    args.carry.apply(&mut how);
    entry::check(&how.entries())?;
    Ok(carries.then_some(how))
}
