//! Cameras that move, and renderers whose frames follow them.
#![allow(dead_code)]
use glam::{Quat, Vec3};
use tallow::gpu::{FrameResources, Gpu, PassTime, Recorder};
use tallow::layout::{Camera, PixelLight, PixelStats, SurfacePoint};
use tallow::render::{Moves, Outputs, Renderer, Reproject, Reprojection, Step, carried_samples};
use tallow::scene::Loaded;

/// The ways by which frames come to samples of the last.
pub const WAYS: [Reprojection; 2] = [Reprojection::Forward, Reprojection::Backward];

/// A way, and the settings that nobody asked to be others.
pub fn by(reproject: Reprojection) -> Reproject {
    Reproject { reproject, ..Reproject::default() }
}

/// The camera turned to the left around its own vertical axis, in degrees.
pub fn turned(camera: Camera, degrees: f32) -> Camera {
    let turn = Quat::from_axis_angle(Vec3::from(camera.up).normalize(), degrees.to_radians());
    let of = |v: [f32; 3]| (turn * Vec3::from(v)).to_array();
    Camera { right: of(camera.right), forward: of(camera.forward), up: of(camera.up), ..camera }
}

/// The camera moved by lengths along its own unit axes: to the right, up, forward.
pub fn shifted(camera: Camera, by: [f32; 3]) -> Camera {
    let axes = [camera.right, camera.up, camera.forward].map(|axis| Vec3::from(axis).normalize());
    let off = by[0] * axes[0] + by[1] * axes[1] + by[2] * axes[2];
    Camera { position: (Vec3::from(camera.position) + off).to_array(), ..camera }
}

/// A renderer whose frames begin with the last one's samples.
pub struct Film {
    pub renderer: Renderer,
    gpu: Gpu,
    frame: FrameResources,
    pub camera: Camera,
    /// Whether the next frame is the first.
    begun: bool,
}

impl Film {
    /// Of a scene in which the camera alone moves.
    pub fn new(gpu: &Gpu, scene: &Loaded, settings: Reproject) -> Self {
        Self::following(gpu, scene, settings, Moves::Camera, Outputs::FILTERED)
    }

    /// The same, of what no filter follows.
    pub fn unfiltered(gpu: &Gpu, scene: &Loaded, settings: Reproject) -> Self {
        let outputs = Outputs { split_light: false, ..Outputs::FILTERED };
        Self::following(gpu, scene, settings, Moves::Camera, outputs)
    }

    /// Of one in which anything may.
    pub fn moving(gpu: &Gpu, scene: &Loaded, settings: Reproject) -> Self {
        Self::following(gpu, scene, settings, Moves::Scene, Outputs::FILTERED)
    }

    fn following(gpu: &Gpu, scene: &Loaded, settings: Reproject, moves: Moves, outputs: Outputs) -> Self {
        let mut renderer = Renderer::new(gpu, scene, &scene.settings, outputs).unwrap();
        renderer.keep_history(settings, moves).unwrap();
        let camera = scene.camera(scene.settings.size()).unwrap();
        Self { gpu: gpu.clone(), renderer, frame: FrameResources::new(gpu).unwrap(), camera, begun: false }
    }

    pub fn step(&mut self, step: &Step) {
        self.renderer.run(&mut self.frame, step).unwrap();
    }

    /// Lets the next frame begin with nothing.
    pub fn restart(&mut self) {
        self.begun = false;
    }

    /// Runs what changes the renderer as it is recorded.
    pub fn record(&mut self, record: impl FnOnce(&mut Renderer, &mut Recorder) -> tallow::error::Result<()>) {
        let (gpu, renderer) = (&self.gpu, &mut self.renderer);
        gpu.run(&mut self.frame, |rec| record(renderer, rec)).unwrap();
    }

    /// Renders a frame from `camera`, with samples that no frame before had.
    pub fn frame(&mut self, camera: Camera) {
        self.renderer.set_camera(camera).unwrap();
        let steps: Vec<Step> =
            if self.begun { self.renderer.steps_on().collect() } else { self.renderer.steps().collect() };
        steps.iter().for_each(|step| self.step(step));
        let (first, spp) = (self.renderer.settings().first_sample, self.renderer.settings().spp);
        self.renderer.set_first_sample(first + spp);
        self.begun = true;
    }

    /// Renders a frame from `camera` by a policy, with a seed of its own. Returns what it began with.
    pub fn placed_frame(&mut self, camera: Camera, seed: u32) -> Vec<PixelStats> {
        self.renderer.set_camera(camera).unwrap();
        self.renderer.set_seed(seed);
        let (_, steps) = self.renderer.begin_frame(&mut self.frame).unwrap();
        let begun = self.stats();
        steps.iter().for_each(|step| self.step(step));
        begun
    }

    /// Begins a frame from `camera`, and renders nothing. Returns the passes that this took.
    pub fn begin(&mut self, camera: Camera) -> Vec<PassTime> {
        self.renderer.set_camera(camera).unwrap();
        self.renderer.run(&mut self.frame, &Step::Reproject).unwrap()
    }

    pub fn stats(&self) -> Vec<PixelStats> {
        self.renderer.film().tiles[0].stats.read().unwrap()
    }

    pub fn light(&self) -> Vec<PixelLight> {
        self.renderer.film().tiles[0].light.read().unwrap()
    }

    pub fn points(&self) -> Vec<SurfacePoint> {
        self.renderer.film().tiles[0].points.read().unwrap()
    }

    pub fn carried(&self) -> Vec<u32> {
        self.renderer.history().unwrap().carried.read().unwrap()
    }

    pub fn offered(&self) -> Vec<u32> {
        self.renderer.history().unwrap().offered.read().unwrap()
    }
}

/// Share of pixels, of those with samples carried, whose mean is farther than four standard errors from that of a direct render,
/// and the mean of the errors of all in units of the picture's brightness.
pub fn truth(stats: &[PixelStats], words: &[u32], direct: &[PixelStats]) -> [f64; 2] {
    let (mut wrong, mut all, mut off, mut light) = (0.0, 0.0, 0.0, 0.0);
    for ((s, d), _) in stats.iter().zip(direct).zip(words).filter(|(_, word)| carried_samples(**word) > 0) {
        let variance = |s: &PixelStats| f64::from(s.m2[1]) / f64::from(s.count) / f64::from(s.count.max(2) - 1);
        let difference = f64::from(s.mean[1]) - f64::from(d.mean[1]);
        // The deviation of the direct render stands for that of the few samples, which may be alike by chance.
        let error = (variance(d) * f64::from(d.count) / f64::from(s.count) + variance(d)).sqrt();
        let right = difference.abs() <= 4.0 * error + 1e-3; // not so of what is no number
        wrong += f64::from(u8::from(!right));
        (all, off, light) = (all + 1.0, off + difference, light + f64::from(d.mean[1]));
    }
    [wrong / all, off / light]
}
