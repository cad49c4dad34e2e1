// A diffuse base under a dielectric coat: src/material/coated.rs.
#ifndef LIB_BSDF_COATED_GLSL
#define LIB_BSDF_COATED_GLSL

#include "lib/bsdf.glsl"
#include "lib/fresnel.glsl"
#include "lib/ggx.glsl"

struct Bsdf {
    vec3 base;         // albedo
    float base_scale;  // 1 / (1 - average albedo of the coat)
    float excess;      // η² - 1 of the coat
    float alpha;       // of the coat; 0: smooth
    uvec2 coat;        // address of its CoatTable: SwiftShader crashes on a reference inside a struct that is constructed
    float row;         // which of its roughnesses, and how far to the next; negative: it has but one
};

uint coat_row(float row) {
    return min(uint(row), COAT_TABLE_ROUGHNESSES - 2u);
}

float coat_average(uvec2 table, uint row) {
    return CoatTable(table).albedo[COAT_TABLE_ROUGHNESSES * COAT_TABLE_LENGTH + row];
}

Bsdf bsdf_make(MaterialRecord material, vec3 color) {
    float excess = (material.ior - 1.0) * (material.ior + 1.0);
    Bsdf b = Bsdf(color, material.base_scale, excess, material.alpha.x, material.table, -1.0);
    if (has_roughness_map(material) && b.alpha > 0.0) {
        b.row = sqrt(sqrt(b.alpha)) * float(COAT_TABLE_ROUGHNESSES - 1u);
        uint row = coat_row(b.row);
        float average = mix(coat_average(b.coat, row), coat_average(b.coat, row + 1u), b.row - float(row));
        b.base_scale = 1.0 / (1.0 - average);
    }
    return b;
}

bool bsdf_is_delta(Bsdf b) {
    return false;
}

// What a row of the table says between two of its cosines.
float coat_albedo(uvec2 table, uint row, float position) {
    uint cell = min(uint(position), COAT_TABLE_LENGTH - 2u);
    uint at = row * COAT_TABLE_LENGTH + cell;
    return mix(CoatTable(table).albedo[at], CoatTable(table).albedo[at + 1u], position - float(cell));
}

// The share of light from this angle that the coat reflects (x), and that it lets through (y).
vec2 coat_split(Bsdf b, float cosine) {
    if (b.alpha == 0.0) return fresnel_dielectric(min(cosine, 1.0), b.excess);
    bool is_mapped = HAS_ROUGHNESS_MAPS && b.row >= 0.0;
    float position = sqrt(sqrt(clamp(cosine, 0.0, 1.0))) * float(COAT_TABLE_LENGTH - 1u);
    uint row = is_mapped ? coat_row(b.row) : 0u;
    float reflected = coat_albedo(b.coat, row, position);
    if (is_mapped) {
        reflected = mix(reflected, coat_albedo(b.coat, row + 1u, position), b.row - float(row));
    }
    return vec2(reflected, 1.0 - reflected);
}

// The probabilities of sampling the coat (x) and the base (y).
vec2 lobe_probabilities(Bsdf b, vec2 coat) {
    vec2 share = vec2(coat.x, coat.y * max(b.base.x, max(b.base.y, b.base.z)));
    float sum = share.x + share.y;
    return share.x > 0.0 ? share / sum : vec2(0.0, 1.0);
}

// f and pdf for facets along h, of any length, that are lit at `cosine`.
vec4 coated_eval_pdf(Bsdf b, vec3 wo, vec3 wi, vec3 h, float cosine) {
    vec2 coat = coat_split(b, wo.z);
    vec2 probability = lobe_probabilities(b, coat);
    float through = coat.y * coat_split(b, wi.z).y * b.base_scale;
    vec4 value = INV_PI * vec4(b.base * through, probability.y * wi.z);
    if (b.alpha > 0.0) {
        vec2 alpha = vec2(b.alpha);
        float so = ggx_stretch(wo, alpha);
        float si = ggx_stretch(wi, alpha);
        float d = 0.5 * ggx_distribution(h, alpha);
        float reflected = fresnel_dielectric(clamp(cosine, 0.0, 1.0), b.excess).x;
        value += vec4(vec3(reflected * d / (wo.z * si + wi.z * so)), probability.x * d / (wo.z + so));
    }
    return value;
}

vec4 bsdf_eval_pdf(Bsdf b, vec3 wo, vec3 wi) {
    if (min(wo.z, wi.z) < MIN_COSINE) return vec4(0.0);
    vec3 h = wo + wi;
    return coated_eval_pdf(b, wo, wi, h, 0.5 * length(h));
}

BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec3 u) {
    if (wo.z < MIN_COSINE) return bsdf_no_sample();
    vec2 coat = coat_split(b, wo.z);
    float probability = lobe_probabilities(b, coat).x;
    bool is_coat = u.z < probability;
    if (is_coat && b.alpha == 0.0) return BsdfSample(vec3(-wo.xy, wo.z), probability, vec3(coat.x / probability), true);
    vec3 wi, h;
    float cosine;
    if (is_coat) {
        // wo + wi would no longer tell where in a narrow lobe the facet is.
        h = ggx_sample(wo, vec2(b.alpha), u.xy);
        cosine = dot(wo, h);
        wi = normalize(2.0 * cosine * h - wo);
    } else {
        wi = sample_cosine_hemisphere(u.xy);
        h = wo + wi;
        cosine = 0.5 * length(h);
    }
    if (wi.z < MIN_COSINE) return bsdf_no_sample();
    vec4 value = coated_eval_pdf(b, wo, wi, h, cosine);
    if (!(value.a > 0.0)) return bsdf_no_sample();
    return BsdfSample(wi, value.a, value.rgb * (wi.z / value.a), false);
}

#endif
