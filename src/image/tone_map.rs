//! From radiance to display: exposure, the Khronos PBR Neutral tone map, sRGB encoding.
//!
//! PBR Neutral (Khronos Group 2024, *PBR Neutral Tone Mapper Specification*) shows a surface's base colour as it is,
//! up to 0.8, and rolls off only what is brighter, without shifting hue: what one wants to see of a material.

/// The most stops that a user may ask for, up or down: a thousand million times as bright, or as dark.
pub const MOST_EXPOSURE: f32 = 30.0;

/// Radiance scaled by 2^`exposure` and mapped to [0, 1], still linear. Negative and NaN become 0.
pub fn neutral([red, green, blue]: [f32; 3], exposure: f32) -> [f32; 3] {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    // Not `clamp`, which keeps NaN; the upper limit keeps ∞ out of the quotients below.
    let scale = exposure.exp2();
    let mut color = [red, green, blue].map(|value| if value > 0.0 { (value * scale).min(1e6) } else { 0.0 });

    let least = color[0].min(color[1]).min(color[2]);
    let offset = if least < 0.08 { least - 6.25 * least * least } else { 0.04 };
    color = color.map(|value| value - offset);

    let peak = color[0].max(color[1]).max(color[2]);
    if peak < START {
        return color;
    }
    let range = 1.0 - START;
    let new_peak = 1.0 - range * range / (peak + range - START);
    let whiten = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.map(|value| {
        let scaled = value * (new_peak / peak);
        scaled + (new_peak - scaled) * whiten
    })
}

/// The sRGB transfer function (IEC 61966-2-1) of a linear value in [0, 1].
pub fn encode_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Tone-mapped, sRGB-encoded pixels, three bytes each.
pub fn to_srgb8(pixels: &[[f32; 3]], exposure: f32) -> Vec<u8> {
    pixels
        .iter()
        .flat_map(|pixel| neutral(*pixel, exposure))
        .map(|value| (encode_srgb(value.clamp(0.0, 1.0)) * 255.0).round() as u8)
        .collect()
}
