/** Reference of the API: Swagger UI with the description that this service publishes. */

globalThis.SwaggerUIBundle({
  url: "/api/v1/openapi.json",
  dom_id: "#reference",
  deepLinking: true,
  validatorUrl: null, // no other server is asked
});
