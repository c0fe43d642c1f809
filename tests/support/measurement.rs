//! A made-up cost measurement: its figures follow simple laws, and nothing was rendered.
use tallow::cost::Images;
use tallow::cost::document::*;
use tallow::image::Picture;

const SPP: [u32; 5] = [1, 4, 16, 64, 256];
/// Allocation, filter, milliseconds of the filter, relMSE at one sample per pixel, and relMSE that stays.
const METHODS: [(&str, &str, f64, f64, f64); 7] = [
    ("uniform", "none", 0.0, 1.2, 0.0),
    ("uniform", "atrous", 4.0, 0.11, 4e-3),
    ("uniform", "auto", 11.0, 0.05, 2e-4),
    ("geometry", "guided", 6.0, 0.07, 1.5e-3),
    ("both", "none", 0.0, 0.7, 0.0),
    ("both", "atrous", 4.0, 0.08, 3e-3),
    ("both", "auto", 11.0, 0.03, 1e-4),
];

/// A measurement of the scene of this name, with one point that failed and one that was not reached.
pub fn document(name: &str) -> Document {
    let mut points: Vec<Point> = METHODS.iter().flat_map(|method| SPP.map(|spp| measured(*method, spp))).collect();
    points.push(shallow(points[31].clone()));
    let method =
        Method { allocate: "both".into(), filter: "svgf".into(), rounds: Some(3), spp: 4, ..Method::default() };
    points.push(Point { failed: Some("filter svgf: the image has no normals".into()), ..empty(method.clone()) });
    points.push(empty(Method { spp: 16, ..method }));
    let front = vec![0, 30, 31, 32, 33, 34];
    let findings = vec![
        finding(Verdict::Clear, "To halve relMSE from 0.01 costs 2.0x the time with uniform, 1.9x with both + auto."),
        finding(Verdict::Clear, "Below 12 ms no filtered method reaches a relMSE of 0.02."),
        finding(Verdict::TooNoisy, "Between both + atrous and geometry + guided at 16 spp the data cannot tell."),
    ];
    Document { points, front, findings, ..nothing_measured(name) }
}

/// A measurement without points.
pub fn nothing_measured(name: &str) -> Document {
    let seeds = vec![11, 12, 13, 14, 15];
    Document {
        schema: SCHEMA,
        complete: false,
        software: Software { version: "0.1.0".into(), commit: Some("0123abc".into()) },
        scene: SceneInfo {
            path: format!("scenes/{name}.toml"),
            name: name.into(),
            width: 192,
            height: 128,
            judged: None,
        },
        machine: Machine {
            device: "Imaginary GPU 9".into(),
            kind: "discrete GPU".into(),
            driver: "driver 1.2.3".into(),
            ray_queries: false,
            cpu: "Imaginary CPU".into(),
            cores: 2,
            cpu_mhz: Some([3000, 3000]),
            device_mhz: Some([1800, 1950]),
        },
        reference: ReferenceInfo {
            source: ReferenceSource::Rendered,
            path: None,
            spp: Some(65_536),
            noise: NoiseKind::Measured,
            mse: Some(1e-6),
            relmse: Some(1.2e-5),
            notes: vec!["its noise is a tenth of the smallest error".into()],
        },
        measurement: Measurement {
            repeats: 5,
            seeds,
            order_seed: 1,
            budget_minutes: Some(10.0),
            confidence: 0.95,
            key: "key".into(),
        },
        points: Vec::new(),
        front: Vec::new(),
        findings: Vec::new(),
    }
}

fn finding(verdict: Verdict, text: &str) -> Finding {
    Finding { verdict, text: text.into() }
}

fn empty(method: Method) -> Point {
    let command = format!("tallow render scene.toml --spp {}", method.spp);
    Point::unmeasured(method, command)
}

fn estimate(value: f64, spread: f64) -> Estimate {
    Estimate { value, low: Some(value / (1.0 + spread)), high: Some(value * (1.0 + spread)) }
}

fn measured((allocate, filter, filter_ms, at_one, stays): (&str, &str, f64, f64, f64), spp: u32) -> Point {
    let method = Method { allocate: allocate.into(), filter: filter.into(), spp, ..Method::default() };
    let n = f64::from(spp);
    let relmse = at_one / n + stays;
    let overhead = if allocate == "uniform" { 0.0 } else { 1.5 };
    let pass = |pass: &str, ms| Pass { pass: pass.into(), calls: spp as usize, ms };
    let mut passes = vec![pass("primary_hit", 0.4), pass("path", 3.1 * n), pass("accumulate", 0.2 * n)];
    if overhead > 0.0 {
        passes.extend([pass("apportion", 0.6), pass("scan", 0.3), pass("sample_list", 0.4), pass("counts", 0.2)]);
    }
    if filter_ms > 0.0 {
        passes.extend([
            pass(filter, 0.8 * filter_ms),
            pass("demodulate", 0.1 * filter_ms),
            pass("copy", 0.1 * filter_ms),
        ]);
    }
    let gpu_ms: f64 = passes.iter().map(|p| p.ms).sum();
    let factor = |value| Some(Factor { estimate: estimate(value, 0.1), extrapolated: spp == 256 });
    let summary = Summary {
        gpu_ms: estimate(gpu_ms, 0.02),
        wall_ms: estimate(gpu_ms + 3.0, 0.05),
        passes: passes.clone(),
        errors: Errors {
            mse: Some(estimate(0.1 * relmse, 0.1)),
            relmse: Some(estimate(relmse, 0.15)),
            relmse_trimmed: Some(estimate(0.8 * relmse, 0.1)),
            psnr: Some(estimate(20.0 - 10.0 * relmse.log10(), 0.01)),
            ssim: Some(estimate(1.0 / (1.0 + relmse), 0.01)),
            flip: Some(estimate(0.3 * relmse.powf(0.4), 0.05)),
            hdr_flip: Some(estimate(0.35 * relmse.powf(0.4), 0.05)),
            outliers: None,
        },
        inefficiency: Some(estimate(relmse * gpu_ms * 1e-3, 0.15)),
        speed_up: factor(1.2 * n / relmse / gpu_ms),
        error_gain: factor(1.2 / relmse / gpu_ms),
        change: None,
    };
    let run = |seed| Run {
        seed,
        gpu_ms,
        wall_ms: gpu_ms + 3.0,
        passes: passes.clone(),
        samples: 192 * 128 * u64::from(spp),
        rays: Some(192 * 128 * 9 * u64::from(spp)),
        errors: Errors { relmse: Some(relmse), ..Errors::default() },
    };
    Point {
        runs: (11..=15).map(run).collect(),
        warm_up: Some(WarmUp { compile_ms: 240.0, first_run_ms: gpu_ms + 35.0 }),
        device_bytes: Some(37 << 20),
        summary: Some(summary),
        ..empty(method)
    }
}

/// A point with paths that end early.
fn shallow(mut point: Point) -> Point {
    point.method.options = vec!["--max-depth 4".to_owned()];
    let [time, relmse, product] = [0.7, 1.2, 0.84].map(|factor| Some(estimate(factor, 0.1)));
    point.summary.as_mut().unwrap().change = Some(Change { time, relmse, product });
    point
}

/// A smooth reference, and for each measured point the same with noise of that point's error.
pub fn images(document: &Document) -> Images {
    let SceneInfo { width, height, .. } = document.scene;
    let truth = |x: u32, y: u32| {
        let (u, v) = (x as f32 / width as f32, y as f32 / height as f32);
        let lamp = if (u - 0.7).hypot(v - 0.3) < 0.08 { 9.0 } else { 0.0 };
        [0.6 * u + lamp, 0.5 * v + lamp, 0.3 + 0.2 * (20.0 * u).sin() * (14.0 * v).cos() + lamp]
    };
    let all = || (0..height).flat_map(|y| (0..width).map(move |x| truth(x, y)));
    let reference = Picture { width, height, pixels: all().collect() };
    let mut random = fastrand::Rng::with_seed(7);
    let mut noisy = |relmse: f64| {
        let amplitude = (3.0 * relmse as f32).sqrt();
        let noise = |p: [f32; 3], r: f32| p.map(|v| v * (1.0 + amplitude * r).max(0.0));
        Picture { width, height, pixels: all().map(|p| noise(p, 2.0 * random.f32() - 1.0)).collect() }
    };
    let of = |point: &Point| point.summary.as_ref()?.errors.relmse;
    let points = document.points.iter().enumerate();
    let points = points.filter_map(|(i, point)| Some((i, noisy(of(point)?.value)))).collect();
    Images { reference, points }
}
