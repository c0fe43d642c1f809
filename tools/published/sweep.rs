//! Searches for the best settings of a filter for one image.
use tallow::denoise::filter::{AtrousForm, FilterSettings, Row, WaveletBasis};

/// One setting and the values to try: numbers, or indices of the variants of a choice.
pub struct Knob {
    name: &'static str,
    values: &'static [f32],
    set: fn(&mut FilterSettings, f32),
    words: &'static [&'static str],
}

impl Knob {
    const fn numbers(name: &'static str, values: &'static [f32], set: fn(&mut FilterSettings, f32)) -> Self {
        Self { name, values, set, words: &[] }
    }

    fn text(&self, value: f32) -> String {
        self.words.get(value as usize).map_or(value.to_string(), |word| (*word).to_owned())
    }
}

const OFF: f32 = f32::INFINITY;

const FORM: Knob = Knob {
    name: "form",
    values: &[0.0, 1.0, 2.0],
    set: |s, v| s.atrous.form = [AtrousForm::Listing, AtrousForm::Squared, AtrousForm::Printed][v as usize],
    words: &["listing", "squared", "printed"],
};
const LEVELS: Knob = Knob::numbers("levels", &[2.0, 3.0, 4.0, 5.0, 6.0], |s, v| s.footprint.levels = v as u32);
const SIGMA_RT: Knob = Knob::numbers("sigma_rt", &[0.03, 0.1, 0.3, 1.0, 3.0, OFF], |s, v| s.edge.sigma_rt = v);
const SIGMA_N: Knob = Knob::numbers("sigma_n", &[0.1, 0.2, 0.4, 0.8, OFF], |s, v| s.edge.sigma_n = v);
const SIGMA_X: Knob = Knob::numbers("sigma_x", &[0.01, 0.03, 0.1, 0.3, 1.0, OFF], |s, v| s.edge.sigma_x = v);

const CHANNELS: Knob = Knob::numbers("channels", &[1.0, 3.0, 4.0], |s, v| s.guided.channels = v as u32);
const RADIUS: Knob =
    Knob::numbers("radius", &[4.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0], |s, v| s.footprint.radius = v as u32);
const EPS_N: Knob = Knob::numbers("eps of the normal", &[1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1], |s, v| {
    s.guided.eps = [v, v, v, s.guided.eps[3]]
});
const EPS_Z: Knob =
    Knob::numbers("eps of the depth", &[1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.03], |s, v| s.guided.eps[3] = v);

const SIGMA_L: Knob = Knob::numbers("sigma_l", &[0.5, 1.0, 2.0, 4.0, 8.0, 16.0], |s, v| s.svgf.sigma_l = v);
const BASIS: Knob = Knob {
    name: "basis",
    values: &[0.0, 1.0],
    set: |s, v| s.wavelet.basis = [WaveletBasis::Cdf22, WaveletBasis::RedBlack][v as usize],
    words: &["cdf22", "red-black"],
};

/// The settings to search for a filter. Every new filter needs an entry here.
fn knobs(filter: &str) -> Vec<Knob> {
    match filter {
        "atrous" => vec![FORM, LEVELS, SIGMA_RT, SIGMA_N, SIGMA_X],
        "bilateral" => vec![RADIUS, SIGMA_RT, SIGMA_N, SIGMA_X],
        "wavelet" => vec![BASIS, LEVELS, SIGMA_RT, SIGMA_N, SIGMA_X],
        "svgf" => vec![LEVELS, SIGMA_L, SIGMA_N, SIGMA_X],
        "guided" => vec![CHANNELS, RADIUS, EPS_N, EPS_Z],
        _ => vec![],
    }
}

/// The result of a search.
pub struct Best {
    /// The least error found.
    pub error: f64,
    /// The settings with that error.
    pub settings: FilterSettings,
    /// Those settings as text.
    pub text: String,
}

/// Minimises `error` along one setting after the other, twice, starting from the defaults.
///
/// # Errors
/// Those of `error`.
pub fn best(
    row: &Row,
    start: FilterSettings,
    mut error: impl FnMut(&FilterSettings) -> anyhow::Result<f64>,
) -> anyhow::Result<Best> {
    let knobs = knobs(row.name);
    let mut best = Best { error: error(&start)?, settings: start, text: String::new() };
    let mut chosen = vec![None; knobs.len()];
    for _ in 0..2 {
        for (knob, chosen) in knobs.iter().zip(&mut chosen) {
            along(knob, &mut best, chosen, &mut error)?;
        }
    }
    let name = |(knob, value): (&Knob, &Option<f32>)| {
        format!("{} {}", knob.name, value.map_or("default".to_owned(), |v| knob.text(v)))
    };
    best.text = knobs.iter().zip(&chosen).map(name).collect::<Vec<_>>().join(", ");
    Ok(best)
}

/// Tries every value of one setting.
fn along(
    knob: &Knob,
    best: &mut Best,
    chosen: &mut Option<f32>,
    error: &mut impl FnMut(&FilterSettings) -> anyhow::Result<f64>,
) -> anyhow::Result<()> {
    for &value in knob.values {
        if *chosen == Some(value) {
            continue;
        }
        let mut settings = best.settings;
        (knob.set)(&mut settings, value);
        let found = error(&settings)?;
        if found < best.error {
            (best.error, best.settings, *chosen) = (found, settings, Some(value));
        }
    }
    Ok(())
}
