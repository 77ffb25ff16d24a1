{{/* The settings that a service shares with others, by what it needs. */}}

{{- define "fluxglobe.environment.store" -}}
- {name: FLUXGLOBE_STORE, value: {{ .Values.store.url | quote }}}
{{- range $name, $value := .Values.store.environment }}
- {name: {{ $name }}, value: {{ $value | quote }}}
{{- end }}
{{- end }}

{{- define "fluxglobe.environment.kafka" -}}
- {name: FLUXGLOBE_KAFKA, value: {{ .Values.kafka.bootstrapServers | quote }}}
- {name: FLUXGLOBE_KAFKA_SECURITY, value: {{ .Values.kafka.security }}}
- {name: FLUXGLOBE_KAFKA_PARTITIONS, value: {{ .Values.kafka.partitions | quote }}}
{{- with .Values.kafka.topicPrefix }}
- {name: FLUXGLOBE_KAFKA_TOPIC_PREFIX, value: {{ . | quote }}}
{{- end }}
# A container that comes back in its pod ends what its predecessor had begun.
- {name: FLUXGLOBE_KAFKA_INSTANCE, valueFrom: {fieldRef: {fieldPath: metadata.name}}}
{{- if include "fluxglobe.kafkaHasUser" . }}
- {name: FLUXGLOBE_KAFKA_SASL_MECHANISM, value: {{ .Values.kafka.saslMechanism }}}
- {name: FLUXGLOBE_KAFKA_USER, valueFrom: {secretKeyRef: {name: {{ .Values.kafka.secretName }}, key: user}}}
- {name: FLUXGLOBE_KAFKA_PASSWORD_FILE, value: /run/secrets/kafka/password}
{{- end }}
{{- if .Values.kafka.caKey }}
- {name: FLUXGLOBE_KAFKA_CA_FILE, value: /run/secrets/kafka/ca.crt}
{{- end }}
{{- end }}

{{- define "fluxglobe.environment.postgis" -}}
- {name: FLUXGLOBE_POSTGIS, value: {{ .Values.postgis.url | quote }}}
- {name: FLUXGLOBE_POSTGIS_PASSWORD_FILE, value: /run/secrets/postgis/password}
{{- if .Values.postgis.caKey }}
- {name: FLUXGLOBE_POSTGIS_CA_FILE, value: /run/secrets/postgis/ca.crt}
{{- end }}
{{- end }}

{{- define "fluxglobe.environment.cluster" -}}
- {name: FLUXGLOBE_CLUSTER, value: "http://{{ include "fluxglobe.fullname" . }}-scheduler:50050"}
{{- end }}

{{- define "fluxglobe.environment.renderWorkers" -}}
- {name: FLUXGLOBE_RENDER_WORKERS, value: "dns:{{ include "fluxglobe.fullname" . }}-render-workers:50061"}
{{- end }}
