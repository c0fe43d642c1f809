//! The buffers of a render: the scene's, the film's, and what is in flight. `P` pixels, `B` paths in flight.
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Location, PART, Recorder, thread_items};
use crate::layout::*;
use crate::render::pass::counts::Counts;
use crate::render::schedule::Batch;
use crate::render::world::World;
use crate::scene::Scene;
use std::borrow::Cow;
use std::ops::Range;

/// The scene on the device. Absent parts are buffers of one element that no kernel reads.
pub struct DeviceScene {
    /// See [`Scene::nodes`]; likewise the others.
    pub nodes: Buffer<BvhNode>,
    /// See [`Scene`].
    pub triangles: Buffer<Triangle>,
    /// See [`Scene`].
    pub shading: Buffer<Shading>,
    /// See [`Scene`].
    pub instances: Buffer<Instance>,
    /// See [`Scene`].
    pub materials: Buffer<Material>,
    /// See [`Scene`].
    pub textures: Buffer<Texture>,
    /// See [`Scene`].
    pub texels: Buffer<u32>,
    /// See [`Scene`].
    pub lights: Buffer<Light>,
    /// See [`Scene`].
    pub light_table: Buffer<AliasEntry>,
    /// See [`Scene`].
    pub light_nodes: Buffer<LightNode>,
    /// See [`crate::scene::Environment`].
    pub environment: Buffer<vec4>,
    /// See [`crate::scene::Environment`].
    pub environment_table: Buffer<AliasEntry>,
    /// One: what paths are told. [`Step::Start`](crate::render::Step::Start) writes it.
    pub camera: Buffer<Camera>,
    /// What rays are traced through where that is done by ray queries.
    pub world: Option<World>,
    parts_that_stay: PartsThatStay,
}

/// What no pose changes, and how many there are of it.
type PartsThatStay = [(&'static str, usize); 6];

fn parts_that_stay(scene: &Scene) -> PartsThatStay {
    let [columns, rows] = scene.environment.as_ref().map_or([0; 2], |sky| [sky.width, sky.height]);
    [
        ("triangles", scene.triangles.len()),
        ("meshes", scene.meshes().len()),
        ("materials", scene.materials.len()),
        ("textures", scene.textures.len()),
        ("columns of texels in its environment", columns as usize),
        ("rows of texels in its environment", rows as usize),
    ]
}

impl DeviceScene {
    /// Copies `scene` to the device, for kernels with these effects.
    ///
    /// # Errors
    /// [`Error::Device`] when it does not fit.
    pub fn new(gpu: &Gpu, scene: &Scene, effects: &Effects) -> Result<Self> {
        let environment = scene.environment.as_ref();
        let triangles = Buffer::from_texels(gpu, "triangles", &scene.triangles)?;
        Ok(Self {
            world: World::new(gpu, scene, &triangles, effects)?,
            nodes: Buffer::from_texels(gpu, "nodes", &scene.nodes)?,
            triangles,
            shading: Buffer::from_texels(gpu, "shading", &shading(scene, effects))?,
            instances: Buffer::from_texels(gpu, "instances", &scene.instances)?,
            materials: Buffer::from_texels(gpu, "materials", &scene.materials)?,
            textures: Buffer::from_texels(gpu, "textures", &scene.textures)?,
            texels: match effects.many_texels {
                true => Buffer::from_wide_texels(gpu, "texels of textures", &scene.texels)?,
                false => Buffer::from_texels(gpu, "texels of textures", &scene.texels)?,
            },
            lights: Buffer::from_texels(gpu, "lights", &scene.lights)?,
            light_table: Buffer::from_texels(gpu, "light_table", &scene.light_table)?,
            light_nodes: Buffer::from_texels(gpu, "light_nodes", &scene.light_nodes)?,
            environment: Buffer::from_texels(gpu, "environment", environment.map_or(&[], |e| &e.texels[..]))?,
            environment_table: Buffer::from_texels(
                gpu,
                "environment_table",
                environment.map_or(&[], |e| &e.table[..]),
            )?,
            camera: Buffer::from_slice(gpu, "camera", &[Camera::default()])?,
            parts_that_stay: parts_that_stay(scene),
        })
    }

    /// Checks that `scene` has as many of all that no pose changes as the one that is here.
    ///
    /// # Errors
    /// [`Error::Usage`] with the first that differs.
    pub(super) fn check_parts(&self, scene: &Scene) -> Result<()> {
        match parts_that_stay(scene).into_iter().zip(self.parts_that_stay).find(|(now, made)| now != made) {
            Some(((what, now), (_, made))) => Err(Error::Usage(format!(
                "the scene has {now} {what}, and this renderer was made for {made}: make a new renderer"
            ))),
            None => Ok(()),
        }
    }

    /// What the kernels bind.
    pub fn bind(&self) -> crate::shaders::shared::scene::Bind<'_> {
        crate::shaders::shared::scene::Bind {
            nodes: &self.nodes,
            triangles: &self.triangles,
            shading: &self.shading,
            instances: &self.instances,
            materials: &self.materials,
            textures: &self.textures,
            texels: &self.texels,
        }
    }

    /// What the kernels bind that choose lights.
    pub fn bind_lights(&self) -> crate::shaders::shared::light::Bind<'_> {
        crate::shaders::shared::light::Bind {
            lights: &self.lights,
            light_table: &self.light_table,
            light_nodes: &self.light_nodes,
            environment: &self.environment,
            environment_table: &self.environment_table,
        }
    }

    /// What the kernels that trace paths bind as well.
    pub fn bind_frame(&self) -> crate::shaders::shared::frame::Bind<'_> {
        crate::shaders::shared::frame::Bind { camera: &self.camera }
    }

    /// What kernels bind that trace by ray queries.
    pub fn bind_world(&self) -> crate::shaders::shared::ray_query::Bind<'_> {
        crate::shaders::shared::ray_query::Bind { world: self.world.as_ref().map(World::acceleration) }
    }

    /// Bytes of each part, largest first.
    pub fn sizes(&self) -> Vec<(&'static str, u64)> {
        let mut sizes = vec![
            ("nodes", self.nodes.raw().size),
            ("triangles", self.triangles.raw().size),
            ("shading", self.shading.raw().size),
            ("instances", self.instances.raw().size),
            ("materials", self.materials.raw().size),
            ("textures", self.textures.raw().size),
            ("texels", self.texels.raw().size),
            ("lights", self.lights.raw().size + self.light_table.raw().size + self.light_nodes.raw().size),
            ("environment", self.environment.raw().size + self.environment_table.raw().size),
        ];
        sizes.extend(self.world.iter().map(|world| ("acceleration", world.acceleration().bytes())));
        sizes.sort_by_key(|s| std::cmp::Reverse(s.1));
        sizes
    }
}

/// The scene's own records, or flat ones where kernels read what the scene does not have (`--effects all`).
fn shading<'a>(scene: &'a Scene, effects: &Effects) -> Cow<'a, [Shading]> {
    let maps = effects.textures || effects.bump_maps || effects.normal_maps || effects.alpha_masks;
    let slopes = effects.anisotropic || effects.coat_normals;
    let read = effects.smooth_normals || effects.vertex_colors || maps || slopes;
    if read && scene.shading.is_empty() {
        return vec![Shading { normal: [u32::MAX; 3], ..Shading::default() }; scene.triangles.len()].into();
    }
    Cow::Borrowed(&scene.shading)
}

/// Bytes of the largest record of a pixel.
const WIDEST: u64 = size_of::<Guide>() as u64;
const _: () = assert!(size_of::<PixelStats>() as u64 <= WIDEST && size_of::<PixelLight>() as u64 <= WIDEST);
// A history is of a film of one tile, whose views of 16-byte texels have room for it too.
const _: () = assert!(size_of::<History>() as u64 <= WIDEST && size_of::<HistoryLight>() as u64 <= WIDEST);
const _: () = assert!(size_of::<History>().is_multiple_of(16) && size_of::<HistoryLight>().is_multiple_of(16));

/// Pixels of the largest tile, whose records fit one buffer and one view of texels, and of a window.
fn extents(gpu: &Gpu) -> [u32; 2] {
    let info = gpu.info();
    let texels = info.max_texel_elements.saturating_mul(16);
    let buffer = info.max_allocation.min(info.max_buffer_size).min(texels);
    whole_windows(buffer.min(gpu.tuning().film_buffer_bytes), info.max_storage_range)
}

/// Most pixels of a film that fits one tile.
pub(super) fn most_of_one_tile(gpu: &Gpu) -> u32 {
    extents(gpu)[0]
}

/// The same for bytes of a tile and of a storage binding.
fn whole_windows(tile: u64, binding: u64) -> [u32; 2] {
    let pixels = |bytes: u64| ((bytes / WIDEST / PART as u64).clamp(1, 1 << 22) * PART as u64) as u32;
    let window = pixels(binding.min(tile));
    [pixels(tile) / window * window, window]
}

/// A run of the film's pixels, row-major, that fits the device's buffers.
pub struct FilmTile {
    /// Index of its first pixel in the film.
    pub first_pixel: u32,
    /// Its pixels.
    pub pixels: u32,
    /// Pixels whose records fit one storage binding, a multiple of [`PART`]: batches never cross its multiples.
    pub window: u32,
    /// Per pixel.
    pub stats: Buffer<PixelStats>,
    /// Per pixel, where direct and indirect light are wanted apart.
    pub light: Buffer<PixelLight>,
    /// Per pixel, where guides are wanted.
    pub guide: Buffer<Guide>,
    /// Per pixel, where guides are wanted and the scene has smooth surfaces or the camera a lens: what these show.
    pub seen: Buffer<Guide>,
    /// Per pixel, where guides are wanted and the camera has a lens: how far it blurs what is seen, from 0, sharp, to 1.
    pub blur: Buffer<f32>,
    /// Per pixel, where a history is kept: the points that its samples are of.
    pub points: Buffer<SurfacePoint>,
    kept: Kept,
}

/// The records in `part` of a buffer that has one for each pixel, and all of one that is bound but not read because they are not kept.
///
/// # Errors
/// As [`Buffer::part`].
pub(super) fn part_if<T: bytemuck::Pod>(is_kept: bool, buffer: &Buffer<T>, part: &Range<usize>) -> Result<Buffer<T>> {
    if is_kept { buffer.part(part.clone()) } else { Ok(buffer.clone()) }
}

/// Which buffers of a tile have a record for each pixel. Of one pixel their lengths would not tell.
#[derive(Clone, Copy)]
struct Kept {
    light: bool,
    guide: bool,
    seen: bool,
    blur: bool,
    points: bool,
}

impl FilmTile {
    /// The tile's pixels, cut into runs whose records fit one storage binding.
    pub fn windows(&self) -> impl Iterator<Item = Range<u32>> + use<> {
        let (pixels, window) = (self.pixels, self.window);
        (0..pixels).step_by(window as usize).map(move |first| first..pixels.min(first + window))
    }

    /// Whether it holds direct and indirect light apart.
    pub fn has_light(&self) -> bool {
        self.kept.light
    }

    /// Whether it holds primary hits.
    pub fn has_guide(&self) -> bool {
        self.kept.guide
    }

    /// Whether it holds what is seen in smooth surfaces or through a lens.
    pub fn has_seen(&self) -> bool {
        self.kept.seen
    }

    /// Whether it holds how far the lens blurs what is seen.
    pub fn has_blur(&self) -> bool {
        self.kept.blur
    }

    /// Whether it holds the points of primary hits.
    pub fn has_points(&self) -> bool {
        self.kept.points
    }

    /// Holds `points`, one for each pixel, from now on.
    pub(super) fn keep_points(&mut self, points: Buffer<SurfacePoint>) {
        self.points = points;
        self.kept.points = true;
    }

    /// Records copies of what a film is read from, which the host reads once the recording is complete.
    pub(super) fn copied(&self, rec: &mut Recorder) -> Result<Self> {
        Ok(Self {
            stats: rec.copied(&self.stats)?,
            light: rec.copied(&self.light)?,
            guide: rec.copied(&self.guide)?,
            seen: rec.copied(&self.seen)?,
            blur: rec.copied(&self.blur)?,
            points: self.points.clone(),
            ..*self
        })
    }

    fn new(gpu: &Gpu, range: Range<u32>, window: u32, effects: &Effects, guides: bool) -> Result<Self> {
        let pixels = range.end - range.start;
        let room = |on: bool| if on { pixels as usize } else { 1 };
        let (light, blur) = (effects.split_light, guides && effects.lens);
        let seen = blur || guides && effects.smooth_interface;
        Ok(Self {
            first_pixel: range.start,
            pixels,
            window,
            stats: Buffer::new(gpu, "stats", pixels as usize, Location::Device)?,
            light: Buffer::new(gpu, "light", room(light), Location::Device)?,
            guide: Buffer::new(gpu, "guide", room(guides), Location::Device)?,
            seen: Buffer::new(gpu, "seen", room(seen), Location::Device)?,
            blur: Buffer::new(gpu, "blur of the lens", room(blur), Location::Device)?,
            points: Buffer::new(gpu, "points", 1, Location::Device)?, // Renderer::keep_history makes room
            kept: Kept { light, guide: guides, seen, blur, points: false },
        })
    }
}

/// What a frame writes. Buffers that the outputs do not call for hold one element.
pub struct FilmBuffers {
    /// vec4 per sample in flight, three with direct and indirect light apart; w of the first is the number of its rays, less
    /// than 0 where the sample is wrong. Overwritten by every batch.
    pub samples: Buffer<vec4>,
    /// The film, in order; one tile unless a device's buffers are too small for that.
    pub tiles: Vec<FilmTile>,
    /// Closest-hit rays, any-hit rays, nodes visited: pairs of words, low first.
    pub counters: Buffer<u32>,
    /// One element.
    pub broken: Buffer<BrokenTally>,
    /// (pixel, sample index) of the paths in flight, where samples are placed.
    pub paths: Buffer<uvec2>,
    /// Per pixel, where samples are placed.
    pub counts: Counts,
    /// One element, which says that no samples are of an earlier frame.
    pub none_carried: Buffer<u32>,
}

impl FilmBuffers {
    /// Room for `pixels` pixels and `paths` paths in flight.
    ///
    /// # Errors
    /// [`Error::Device`] when it does not fit.
    pub fn new(gpu: &Gpu, pixels: u32, paths: u32, effects: &Effects, guides: bool) -> Result<Self> {
        let records = paths as usize * effects.records_per_path();
        let [capacity, window] = extents(gpu);
        let starts = (0..pixels).step_by(capacity as usize);
        let tile = |first: u32| FilmTile::new(gpu, first..pixels.min(first + capacity), window, effects, guides);
        let placed = |n: u32| if effects.adaptive { n } else { 1 };
        Ok(Self {
            paths: Buffer::new(gpu, "paths", placed(paths) as usize, Location::Device)?,
            counts: Counts::new(gpu, placed(pixels), thread_items(gpu, pixels))?,
            samples: Buffer::new(gpu, "samples", records, Location::Device)?,
            tiles: starts.map(tile).collect::<Result<_>>()?,
            counters: Buffer::from_slice(gpu, "counters", &[0; 6])?,
            none_carried: Buffer::from_slice(gpu, "none carried", &[0])?,
            broken: Buffer::from_slice(gpu, "broken samples", &[BrokenTally::default()])?,
        })
    }

    /// What a pixel takes where all outputs are wanted, samples in flight not counted.
    pub fn bytes_per_pixel(placed: bool) -> u64 {
        const PLACED: usize = Counts::BYTES_PER_PIXEL + size_of::<f32>(); // and a policy's own
        let records = size_of::<PixelStats>() + size_of::<PixelLight>() + 2 * size_of::<Guide>() + size_of::<f32>();
        (records + if placed { PLACED } else { 0 }) as u64
    }

    /// What a sample in flight takes.
    pub fn bytes_per_path(effects: &Effects) -> u64 {
        let place = if effects.adaptive { size_of::<uvec2>() } else { 0 };
        (effects.records_per_path() * size_of::<vec4>() + place) as u64
    }

    /// The tile that holds a batch's pixels; a batch never spans two.
    pub fn tile_of(&self, batch: &Batch) -> &FilmTile {
        let after = self.tiles.partition_point(|tile| tile.first_pixel <= batch.first_pixel);
        &self.tiles[after - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_that_reads_records_of_corners_finds_one_of_each_triangle() {
        let scene = Scene { triangles: vec![Triangle::default(); 3], ..Scene::default() };
        let none = Effects::default();
        assert!(shading(&scene, &none).is_empty());
        for effects in [
            Effects { smooth_normals: true, ..none },
            Effects { vertex_colors: true, ..none },
            Effects { textures: true, ..none },
            Effects { bump_maps: true, ..none },
            Effects { normal_maps: true, ..none },
            Effects { coat_normals: true, ..none },
            Effects { anisotropic: true, ..none },
            Effects { alpha_masks: true, ..none },
        ] {
            assert_eq!(shading(&scene, &effects).len(), 3, "{effects:?}");
        }
    }

    #[test]
    fn tiles_are_whole_windows_whichever_limit_is_the_least() {
        // The bytes of a guide a pixel, 64 pixels at a time.
        let pixels = |bytes: u64| (bytes / size_of::<Guide>() as u64 / 64 * 64) as u32;
        assert_eq!(whole_windows(1 << 31, 1 << 27), [16 * pixels(1 << 27), pixels(1 << 27)], "lavapipe");
        assert_eq!(whole_windows(1 << 31, 1 << 32), [pixels(1 << 31); 2], "buffers end before bindings do");
        assert_eq!(whole_windows(u64::MAX, u64::MAX), [1 << 28; 2]);
        assert_eq!(whole_windows(1, 1), [64; 2]);
    }
}
