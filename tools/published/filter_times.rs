//! The filters' times, beside those of EAW's table 2 and GIF's table 2, both on an NVIDIA GTX 285.
use super::{Section, push};
use tallow::denoise::filter::{self, FilterInput, FilterSettings, Planes, Row};
use tallow::gpu::{FrameResources, Gpu, total_ms};
use tallow::layout::Guide;
use tallow::profile::{median, wake};
use tallow::report::html::Table;

const RUNS: usize = 3;

/// EAW's table 2: for each resolution and 0 to 3 weights, the milliseconds of 1, 5 and 10 levels.
const EAW: [([u32; 2], [[f64; 3]; 4]); 3] = [
    ([512, 512], [[0.3, 1.5, 2.9], [0.5, 2.4, 4.7], [0.8, 3.5, 6.9], [1.2, 5.6, 11.0]]),
    ([1024, 1024], [[1.0, 5.0, 11.3], [1.8, 8.7, 17.2], [2.7, 12.9, 26.6], [4.2, 20.9, 41.6]]),
    ([1920, 1080], [[1.9, 9.6, 22.4], [3.5, 16.9, 33.6], [5.0, 25.1, 52.1], [8.2, 42.6, 86.0]]),
];
const LEVELS: [u32; 3] = [1, 5, 10];

/// A line of GIF's table 2, at 1024x768.
struct Line {
    filter: &'static str,
    what: &'static str,
    published: f64,
    set: fn(&mut FilterSettings),
}

const GIF: &[Line] = &[
    Line { filter: "bilateral", what: "radius 16", published: 447.0, set: |s| s.footprint.radius = 16 },
    Line { filter: "bilateral", what: "radius 24", published: 1001.0, set: |s| s.footprint.radius = 24 },
    Line { filter: "bilateral", what: "radius 32", published: 1768.0, set: |s| s.footprint.radius = 32 },
    Line { filter: "atrous", what: "4 levels", published: 54.0, set: |s| s.footprint.levels = 4 },
    Line { filter: "atrous", what: "5 levels", published: 68.0, set: |s| s.footprint.levels = 5 },
    Line { filter: "atrous", what: "6 levels", published: 82.0, set: |s| s.footprint.levels = 6 },
    Line { filter: "guided", what: "1 channel", published: 16.0, set: |s| s.guided.channels = 1 },
    Line { filter: "guided", what: "3 channels", published: 71.0, set: |s| s.guided.channels = 3 },
    Line { filter: "guided", what: "4 channels", published: 80.0, set: |s| s.guided.channels = 4 },
];

/// # Errors
/// Those of the device.
pub fn measure(gpu: &Gpu) -> anyhow::Result<Section> {
    let how = "Milliseconds of the device, medians of 3 runs, on a noisy sphere on a floor: the content does not change the time. \
        The papers' device is a GTX 285.";
    let mut section = Section::new("EAW, table 2, and GIF, table 2: times of the filters", &[how]);
    for (size, published) in EAW {
        section.tables.push(eaw(gpu, size, &published)?);
    }
    let mut table = Table::new("GIF, table 2, 1024x768", &["filter", "settings", "ours", "published"]);
    let input = input([1024, 768]);
    for line in GIF {
        let row = filter::find(line.filter).expect("a row of the table");
        let ms = median_ms(gpu, row, &FilterSettings::default().with(line.set), &input)?;
        push(&mut table, [line.filter.into(), line.what.into(), format!("{ms:.2}"), format!("{:.0}", line.published)]);
    }
    section.tables.push(table);
    Ok(section)
}

fn eaw(gpu: &Gpu, size: [u32; 2], published: &[[f64; 3]; 4]) -> anyhow::Result<Table> {
    let title = format!("EAW, table 2, {}x{}: ours / published", size[0], size[1]);
    let mut table = Table::new(&title, &["weights", "1 level", "5 levels", "10 levels"]);
    let (atrous, input) = (filter::find("atrous").expect("a row of the table"), input(size));
    for (weights, published) in published.iter().enumerate() {
        let mut row = vec![weights.to_string()];
        for (levels, published) in LEVELS.into_iter().zip(published) {
            let ms = median_ms(gpu, atrous, &weighted(weights, levels), &input)?;
            row.push(format!("{ms:.2} / {published:.1}"));
        }
        push(&mut table, row);
    }
    Ok(table)
}

/// Settings with the first `weights` weights in the order of EAW's figure 4: radiance, normal, position.
fn weighted(weights: usize, levels: u32) -> FilterSettings {
    let on = |i: usize, sigma: f32| if i < weights { sigma } else { f32::INFINITY };
    let own = FilterSettings::default();
    own.with(|s| {
        s.footprint.levels = levels;
        s.edge.sigma_rt = on(0, own.edge.sigma_rt);
        s.edge.sigma_n = on(1, own.edge.sigma_n);
        s.edge.sigma_x = on(2, own.edge.sigma_x);
    })
}

/// Time of all passes: the median over some runs, after one in which drivers compile.
///
/// # Errors
/// Those of the device.
pub fn median_ms(gpu: &Gpu, row: &Row, settings: &FilterSettings, input: &FilterInput) -> anyhow::Result<f64> {
    let planes = Planes::new(gpu, input)?;
    let filter = row.compile(gpu, settings, planes.size)?;
    let mut frame = FrameResources::new(gpu)?;
    let mut times = Vec::new();
    wake(gpu)?;
    for _ in 0..=RUNS {
        let passes = gpu.run(&mut frame, |rec| filter.record(rec, &planes))?;
        times.push(total_ms(&passes));
    }
    Ok(median(&times[1..]))
}

/// A noisy sphere on a floor. As EAW says, the content does not change the time.
fn input([width, height]: [u32; 2]) -> FilterInput {
    let noise = |i: u32| (i.wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
    let guide = |i: u32| {
        let (x, y) = ((i % width) as f32 / width as f32 - 0.5, (i / width) as f32 / height as f32 - 0.5);
        let ball = 0.1 - x * x - y * y;
        let (normal, depth) = if ball > 0.0 { ([x, y, ball.sqrt()], 2.0 - ball) } else { ([0.0, 1.0, 0.0], 3.0 - y) };
        Guide { normal, depth, position: [x, y, depth], object: 0, albedo: [0.5; 3], material: 0, ..Default::default() }
    };
    let pixels = 0..width * height;
    let radiance = pixels.clone().map(|i| [noise(3 * i), noise(3 * i + 1), noise(3 * i + 2), 1.0]).collect();
    FilterInput { width, height, radiance, guide: pixels.map(guide).collect(), variance: None }
}
